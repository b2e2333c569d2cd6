"""Trials of the bench against its emulator: every fault in every state, reaction times, cadence.

| module | holds |
|---|---|
| `browser_clients` | real browsers on the page of a run, in a process of their own |
| `cadence` | cadence: a run of some length on the emulated bench, timed from outside |
| `camera_faults` | every fault of the emulated camera in the states of a run that look at it |
| `end_to_end` | a bench of any kind from its first check to the diagnosis |
| `fault_matrix` | every fault of the emulated supply in every state of a run |
| `kilohertz` | a loop at 1 kHz on the emulated DAQ |
| `matrix` | a whole matrix of faults and states |
| `pair_faults` | faults over pairs of source and sensor |
| `process_faults` | every way to lose or stop a process of a run, in every state |
| `reactions` | reaction times of a real run |
| `stand_in` | stands in for the controller of a run and does something wrong in it |
| `whole_run` | a whole `bender hil` seen from outside: its status and its last line against the truth |
| `watched_runs` | `bender benchmark live`: from STOP on the page to an output that is off, while it is watched |
"""
