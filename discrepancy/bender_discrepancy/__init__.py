"""Where simulation and measurement disagree, which effect is missing, how sure that is, and the corrected model."""
