"""Fits by simulation error, re-simulation, and how well the records determine the numbers."""
