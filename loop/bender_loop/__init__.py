"""Closed and open loops: PID block, references, records, the plant protocol and what it is driven with.

| module | holds |
|---|---|
| `bounds` | checks that settings share: a bad value is refused with its name |
| `errors` | the two ways in which a command fails, distinguished by their exit status |
| `control/` | the closed loop in discrete time |
| `fmu/` | FMUs of any make: file, ports, instance, calls, log, and the plant made of them |
| `records/` | records and what is done with them: reading, replay through a plant, comparison |
| `shell/` | what commands share: progress, tables, whole files, complaints about files |
| `tables/` | tables as people have them: text in any layout, binary files, names and units of columns |
"""
