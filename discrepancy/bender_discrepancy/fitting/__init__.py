"""Hypotheses and how they are fitted by the error of the simulated readings.

| module | holds |
|---|---|
| `criterion` | when one hypothesis beats another |
| `hypothesis` | a hypothesis: a model with some effects in it |
| `output_error` | fits by simulation error |
| `special_starts` | scans of the effects whose misfit has many narrow valleys |
| `starts` | where a fit of one more effect should set out: values that promise most, found without fitting |
| `uncertainty` | how well the records determine what was fitted |
| `visible_modes` | modes that no reading shows |
"""
