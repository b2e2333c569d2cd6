"""One file for each table, figure and equation of the paper, each with a function `show`.

| module | exhibit |
|---|---|
| `table_1` | the beam's materials, its resonance and stiffness |
| `figure_4` | sparse regression on data of the paper's Bouc-Wen model |
| `figure_5` | the same under noise |
| `figure_6` | the learned model over the recording |
| `equation_30` | the learned equation and its coefficients |
| `figure_8` | the staircase and its two lines |
| `figure_9` | the search for gains |
| `figure_10` | step responses |
| `figure_11` | the step to 20 um on the bench |
"""
