"""The runner: a loop that the camera clocks, between the eyes and the guard.

| module | holds |
|---|---|
| `buffered` | a run without a loop: the source plays and the sensor records by one clock |
| `control_law` | the control law at one tick |
| `following_program` | a run that follows a model |
| `foreign_program` | a run with anybody's controller FMU |
| `frames` | the frames around a trip: a ring of the newest ones, written as PNG when a run ends badly |
| `interrupts` | signals that ask for the end |
| `loop` | the loop: a frame comes, the tip is found, the programme decides, the guard is told |
| `oscillation` | oscillation: more swings of the tip or the command than the set-point explains |
| `picture_checks` | does the picture answer the command? |
| `program` | what a run does at each tick: follow a setpoint with the PID block, or play voltages |
| `run` | one run on a bench, from the bench file to the record |
| `run_folder` | the directory of a run, and what the run was made with |
| `run_lock` | who else runs a bench on this machine |
| `steadiness` | how steadily readings come at rest, and the limits of the guard that follow from it |
| `tip_camera` | the eyes: the newest frame of the camera, and where the tip is in it |
| `voltages` | voltages over time for open-loop runs: the staircase and the sine of the paper, or a file |
"""
