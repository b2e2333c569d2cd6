"""What the units say together.

| module | holds |
|---|---|
| `experiment` | the experiment that would settle most of the ambiguous units |
| `features` | the numbers of a unit that are compared, from the tables |
| `outliers` | units that stand out, by robust distance, and why |
| `trends` | what goes with the date, and which batch differs |
"""
