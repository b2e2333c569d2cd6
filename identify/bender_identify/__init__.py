"""Hysteresis models learned from records: sparse regression and operators, judged by re-simulated displacement."""
