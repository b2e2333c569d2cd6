"""How well the tip is found: errors against the renderer's truth, time, silent failures, and the scale's error.

| module | holds |
|---|---|
| `accuracy` | errors of the tip against the truth, case by case, for both methods |
| `cases` | the conditions under which the tip's error is measured |
| `mishaps` | frames with which something is wrong |
| `pictures` | frames that were read wrongly, kept to be looked at |
| `scale` | error of the scale that is found from drawn pictures of a stage micrometer |
| `silence` | silent failures: frames from which a wrong displacement is read without a word |
"""
