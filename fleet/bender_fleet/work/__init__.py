"""What is done with one unit in a worker.

| module | holds |
|---|---|
| `compare` | the FMU driven with the records of a unit |
| `diagnose` | the diagnosis of a unit |
| `identify` | a hysteresis model learned from the records of a unit |
| `job` | one unit's work: read, do, write, and what becomes of failures |
| `watch` | a watch over the later records of a unit |
| `reading` | how the files of records are read |
"""
