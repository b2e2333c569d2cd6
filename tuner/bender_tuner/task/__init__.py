"""What is tuned: settings, search space, experiment, objectives, and the methods at work.

| module | holds |
|---|---|
| `contenders` | everything that competes on one problem |
| `doubts` | devices without an effect that only a model has |
| `experiment` | the run that an objective judges: a step of the setpoint in the closed loop |
| `following` | model following: the shaper and the horizon that suit a model |
| `interrupts` | ctrl-C, SIGTERM and SIGHUP that wait until no FMU call is running |
| `judgement` | what a set of gains is worth, by the same yardstick whichever method found it |
| `objectives` | objectives: gains to one number that a search makes small, with what stands behind it |
| `practitioner` | the practitioner's objective: quick tracking that survives a wrong gain and a late frame |
| `problem` | a plant and settings made into a tuning problem |
| `recommendation` | whether a model is followed: shapers and horizons beside the PID block alone and the rules |
| `search_space` | where an optimiser's point in the unit cube becomes a set of gains |
| `session` | one tuning from the FMU file to the files in the output directory |
| `settings` | what a tuning is asked to do, checked when it is made |
| `tuning` | the methods at work: searches by ask and tell, and the design rules beside them |
"""
