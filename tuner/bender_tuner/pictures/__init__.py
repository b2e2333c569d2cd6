"""Pictures of a tuning."""
