"""Records made ready for identification, what they excite, and voltages that nobody recorded."""
