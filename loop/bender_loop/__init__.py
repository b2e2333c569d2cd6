"""Closed and open loops: PID block, references, records, the plant protocol and what it is driven with."""
