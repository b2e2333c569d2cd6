"""The runner: a loop that the camera clocks, between the eyes and the guard."""
