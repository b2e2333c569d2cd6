"""Sparse regression: terms, rates, supports, the learned equation."""
