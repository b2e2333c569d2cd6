"""The next experiment: voltage profiles, and the design that makes rivals differ most."""
