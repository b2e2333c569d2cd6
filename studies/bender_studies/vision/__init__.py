"""How well the tip is found: errors against the renderer's truth, time, silent failures, and the scale's error."""
