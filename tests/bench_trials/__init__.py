"""Trials of the bench against its emulator: every fault in every state of a run, every process killed in every phase.

| module | holds |
|---|---|
| `__main__` | `python -m bench_trials`, in `tests/`: whole matrices; the tests run slices of them |
| `camera_faults` | every fault of the emulated camera in the states of a run that look at it |
| `fault_matrix` | every fault of the emulated supply in every state of a run |
| `kills` | one investigation in real time, every process killed in every phase, and resumed |
| `matrix` | a whole matrix of faults and states |
| `pair_faults` | faults over pairs of source and sensor |
| `played_rows` | whether any row was played twice, by the journals and by the log of the supply |
| `process_faults` | every way to lose or stop a process of a run, in every state |
| `stand_in` | stands in for the controller of a run |
| `standing_bench` | an emulated bench that outlives the programs that drive it |
"""
