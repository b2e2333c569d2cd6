"""Operators of hysteresis fitted to records, and the linear rival of all of them."""
