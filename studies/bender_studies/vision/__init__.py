"""How well the tip is found: errors against the renderer's truth, time, and the scale's error.

| module | holds |
|---|---|
| `accuracy` | errors of the tip against the truth, case by case, for both methods |
| `cases` | the conditions under which the tip's error is measured |
| `scale` | error of the scale that is found from drawn pictures of a stage micrometer |
"""
