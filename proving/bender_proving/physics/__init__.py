"""The physics of the hidden benches, from command to reading, by an integrator of its own.

| module | holds |
|---|---|
| `duhem` | rate-independent memory as a differential equation in the voltage, advanced along its path |
| `grid` | sub-steps between everything that happens: commands that act, readings, corners of the supply |
| `lobatto` | five-point Lobatto IIIA collocation, the integrator of every stage of the bench |
| `material` | the material: from the electrode voltage to the displacement that drives the structure |
| `nonlinear_mode` | the first mode with a restoring force or a damping that is not linear |
| `play` | play between the tip and what is read of it |
| `preisach` | Preisach's relays with a smooth density, exact for any path of the voltage at 0 V and above |
| `segments` | the electrode voltage between two commands, in closed form |
| `sensor` | the sensor: from the tip in its room to the reading |
| `spectra` | creep as many slow copies |
| `structure` | the structure: from what drives it to the true tip |
| `supply` | the supply: from the command to the electrode voltage |
| `surroundings` | the surroundings: what time alone adds to the tip or takes from it |
| `uncatalogued/` | physics of effects that no catalogue should have |
"""
