"""Investigations of benches that hide something, in virtual time; one that is killed again and again, in real time.

| module | holds |
|---|---|
| `virtual_bench` | a hidden bench that plays as fast as it can be computed |
| `trial` | one bench investigated in a process of its own, held to the truth |
| `figures` | the counts of many trials |
| `kills` | one investigation in real time, every process killed in every phase, and resumed |
| `kill_figures` | its table |
| `played_rows` | whether any row was played twice, by the journals and by the log of the supply |
| `standing_bench` | an emulated bench that outlives the programs that drive it |
"""
