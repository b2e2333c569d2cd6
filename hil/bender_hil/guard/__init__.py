"""The guard: the one process that owns the supply, and the only way the output is switched on or off."""
