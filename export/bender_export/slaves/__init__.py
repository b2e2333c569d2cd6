"""The scripts that run inside the FMUs.

They are ordinary modules here, so that they are checked like any other code; the builder copies them into the FMU
under content-hashed names, with the packages that they import.

| module | holds |
|---|---|
| `controller` | the PID block as an FMI slave: one communication step is one sample of the controller |
| `following` | the model-following controller as an FMI slave, with the plant of the model that it follows |
| `plant` | the plant as an FMI slave: the chain of blocks of `bender_plant`, stepped by the host |
| `reference` | the reference as an FMI slave: a setpoint that climbs a staircase, or makes a single step |
| `stage` | stages of the chain by themselves, to stand before or behind a plant that is not ours |
| `shell` | what the slaves of all FMUs share |
"""
