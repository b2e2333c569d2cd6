"""Hypotheses and how they are fitted by the error of the simulated readings.

| module | holds |
|---|---|
| `blocked` | whether an effect would be named again on other blocks |
| `criterion` | when one hypothesis beats another |
| `fit_problem` | what a hypothesis is fitted to: the base model, the records, and the readings it gives for them |
| `hypothesis` | a hypothesis: a model with some effects in it |
| `journal` | what a search has fitted so far, for a diagnosis that goes on |
| `level_cell` | the step of a quantiser, within which every command stays on its level |
| `output_error` | fits by simulation error |
| `own_numbers` | the model's own linear numbers, free beside effects |
| `scans` | scans of the effects whose misfit has many narrow valleys |
| `standing` | what the numbers of a hypothesis would take over beside a further effect |
| `starts` | where a fit of one more effect should set out: values that promise most, found without fitting |
| `profile` | 95 % intervals by profile likelihood |
| `uncertainty` | how well the records determine what was fitted |
| `visible_modes` | modes that no reading shows |
| `whitening` | the part of a residual that its past does not foretell |
"""
