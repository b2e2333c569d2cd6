"""What the searches are worth, and what an evaluation costs: the figures that the documentation quotes.

`study` runs every method on two plants against an optimum found in the same run; `speed` holds the loop against the
bare FMU calls. Both get the FMU files from their caller.

| module | holds |
|---|---|
| `figures` | from runs to the figures of a table |
| `method_runs` | one run of one method with one seed |
| `optimum` | the optimum that the methods are held against |
| `plants` | the two closed loops on which the methods are compared, each around the FMU of a built-in model |
| `speed` | what an evaluation costs |
| `study` | the comparison of the methods: settings, order of the work, result |
"""
