"""The guard: the one process that owns the supply, and the only way the output is switched on or off.

| module | holds |
|---|---|
| `descent` | the way down: ramp to zero, output off, verified, and measured to be harmless |
| `guard` | the guard's course: open, arm, watch, come down |
| `output` | the guarded output: clamps, the slew limit, and what is asked of the supply between commands |
| `played` | voltages that the source plays from its own buffer, judged before they begin |
| `rescue` | a spare guard without a controller, for the watchman |
| `rules` | the rules that end a run, as a pure function of the situation |
| `settings` | what the guard holds the run to |
| `slew` | the slew limit as a bucket of volts |
| `spares` | what comes after a guard that is lost: listening, spare guards, the alarm when it is due |
| `start` | the controller's side of the guard: start it, command it, wait for its end |
| `stop_ear` | the guard's ear for STOP, which nothing stands between |
| `watched` | the controller's side of the watchman |
| `watchman` | a third process that does nothing but wait for controller and guard |
"""
