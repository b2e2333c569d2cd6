"""The physics of the hidden benches, from command to reading, by an integrator of its own."""
