"""Tuning rules in closed form, and gains in the forms of other controllers."""
