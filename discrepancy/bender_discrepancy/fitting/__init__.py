"""Hypotheses and how they are fitted by the error of the simulated readings."""
