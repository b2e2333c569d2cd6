"""Tuning of the PID block against any plant: search spaces, design rules, objectives, analysis, gain export."""
