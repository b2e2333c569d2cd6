"""The camera: newest frame, honest times, counted losses."""
