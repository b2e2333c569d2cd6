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

| module | holds |
|---|---|
| `equation_30` | equation (30): its coefficients learned back, and what kind of equation it is |
| `figure_10` | figure 10: the simulated step of 10 um, tuned by the beetle and by Ziegler and Nichols' rule |
| `figure_11` | figure 11: the step of 20 um on the bench, with the gains of the simulation |
| `figure_4` | figure 4: the simulated Bouc-Wen model learned back, and what 2.74e-6 % is |
| `figure_5` | figure 5: the tip under 10 sin(pi t + 0.5) V, frame by frame |
| `figure_6` | figure 6: the hysteresis loop learned from the recording, and its error on held-out rows |
| `figure_8` | figure 8: the staircase 0, 1,  |
| `figure_9` | figure 9: the gains over the iterations of the search |
| `table_1` | table 1, and what equations (2), (3) and (10) to (12) make of it |
"""
