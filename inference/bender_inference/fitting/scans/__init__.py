"""Scans of the effects whose misfit has many narrow valleys: where a fit of one of them should set out.

| module | holds |
|---|---|
| `chosen` | the scan that suits a form |
| `delay` | a delay, on one simulation that is read at shifted instants |
| `hum` | a disturbance, in the spectrum of the residual |
| `jumps` | a number by which the misfit falls in jumps |
| `limit` | the level of a limit of the output, scanned by cutting off what the hypothesis gives |
| `misfit` | the square of a residual, and its valleys |
| `second_mode` | a second mode, by rings of all frequencies held against the residual |
| `supply_steps` | steps of the supply, by what rounding takes off the residual |
"""
