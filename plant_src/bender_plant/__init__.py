"""The piezo bending actuator: composite beam, hysteresis and the chain of blocks between command and reading.

Standard library only, relative imports only: the package is carried whole inside every plant FMU.

| module | holds |
|---|---|
| `composite_beam` | the layered cantilever |
| `model` | a model is data: a beam, and the blocks of the chain with their values, in a TOML file |
| `origin` | where a model that was learned comes from |
| `parabola` | parabolas over a sub-step, given by their values at its start, middle and end |
| `parameter` | parameters that carry their unit |
| `plant` | the plant: a chain of blocks from the command to the reading, stepped from outside |
| `substeps` | how a communication step is cut |
| `valid_range` | where a model that was learned from records is valid |
| `variables` | the table of FMI variables |
| `blocks/` | the blocks of the chain, each one file |
| `kernels/` | steps that several blocks share |
"""
