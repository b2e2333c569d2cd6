"""What the searches are worth, and what an evaluation costs: the figures that the documentation quotes.

`study` runs every method on two plants against an optimum found in the same run; `speed` holds the loop against the
bare FMU calls and against a tuning written with `simulate_fmu`. Both get the FMU files from their caller.

| module | holds |
|---|---|
| `bare_fmu` | the other ways to the same step response |
| `figures` | from runs to the figures of a table, and from the figures to plain sentences |
| `method_runs` | one run of one method with one seed |
| `optimum` | the optimum that the methods are held against |
| `outputs` | the comparison of the methods as JSON, and written out |
| `plants` | the two closed loops on which the methods are compared, each around the FMU of a built-in model |
| `pool` | tasks on one plant, in parallel processes that each open its FMU once |
| `speed` | what an evaluation costs, as ratios within one run wherever that is possible |
| `study` | the comparison of the methods: settings, order of the work, result |
"""
