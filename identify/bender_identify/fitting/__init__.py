"""Fits by simulation error, re-simulation, and how well the records determine the numbers.

| module | holds |
|---|---|
| `candidate` | a fitted model of hysteresis, whatever its form |
| `correlation` | how many readings of a correlated residual count as one |
| `identifiability` | what the records cannot tell |
| `output_error` | parameters by the error of the simulated output: least squares over whole records |
| `repeating` | a residual that comes back in every cycle |
| `resimulation` | models re-simulated over experiments: the only thing that they are judged by |
"""
