"""FMUs of any make: file, ports, instance, calls, log, and the plant made of them.

| module | holds |
|---|---|
| `calls` | the FMI calls of a communication step, made as cheap as Python allows |
| `controller` | any FMU that takes a set-point and a measurement and gives a command, as a controller |
| `diagnosed` | what the diagnosis beside a model says of it |
| `elsewhere` | functions that run where their plant lives |
| `file` | what can be said of an FMU file before it is loaded |
| `followed_model` | a model that a controller follows, as data, and the controller that it makes in a loop |
| `follower` | a model-following controller as its host sees it |
| `following_models` | the two models of a model-following controller, both from one FMU |
| `instance` | one instance of an FMU |
| `log` | what FMUs log, kept for the instance that logged it |
| `plant` | any co-simulation FMU (FMI 2.0 or 3.0) with a voltage input and a displacement output as a plant |
| `ports` | which variables of an FMU are used: its input, its output, its parameters |
| `schedule` | further inputs of an FMU over the time of a record |
| `slave3` | FMI 3.0 co-simulation spoken as FMI 2.0 |
| `start_values` | values of parameters by `--set NAME=VALUE` |
| `archive/` | what an archive and its libraries may be before a byte of it is unpacked |
| `process/` | an FMU that is not ours, in a process of its own that is watched |
| `check/` | every check at hand on any FMU |
"""
