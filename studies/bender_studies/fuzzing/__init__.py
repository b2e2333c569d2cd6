"""Inputs that nobody would send on purpose, by the thousand: values, steps, legal call orders, damaged archives."""
