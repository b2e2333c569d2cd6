"""Records made ready for a diagnosis: observations, excitation, excerpts, noise floor, outliers, lattice, start."""
