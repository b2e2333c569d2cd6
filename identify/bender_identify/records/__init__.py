"""Records made ready for identification, what they excite, and voltages that nobody recorded.

| module | holds |
|---|---|
| `excitation` | what the voltage of a record excites: nothing, one cycle over and over, or more |
| `experiment` | a record made ready for fits: what drove it, which rows count, and which of them are held out |
| `extrapolation` | a voltage that nobody recorded |
| `memory` | how long a linear model answers a command |
| `voltage_path` | the path of the voltage between and before the rows of a record |
"""
