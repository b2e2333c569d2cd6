"""A sparse equation for a residual that no effect of the catalogue explains."""
