"""The bench: supply, camera, guard, runner, and an emulated bench that is real down to the wire.

| module | holds |
|---|---|
| `bench_file` | the bench file |
| `command` | `bender hil`: the PID block, or a voltage profile, on a bench |
| `emulated` | the emulated bench of a bench file, and what the file would say of a real one |
| `learning` | `bender hil --learn N`: a profile is run again and again |
| `realtime` | priority over everything else on the machine, where the operating system grants it |
| `recent_range` | lowest and highest level of late |
| `check/` | `bender bench check`: what is connected, what it answers, what is missing |
| `calibration/` | what a pixel is worth, found from pictures of a stage micrometer |
| `live/` | the page on which a run is watched and stopped |
| `camera/` | the camera: newest frame, honest times, counted losses |
| `guard/` | the guard: the one process that owns the supply |
| `log/` | the log of a run |
| `runner/` | the runner: a loop that the camera clocks, between the eyes and the guard |
| `sensors/` | sensors that are no camera |
| `sources/` | sources beside the supply, and amplifiers |
| `supply/` | supplies: capabilities and dialects as tables, one driver over them, links over PyVISA |
"""
