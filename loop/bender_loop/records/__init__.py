"""Records and what is done with them: reading, units, replay through a plant, comparison."""
