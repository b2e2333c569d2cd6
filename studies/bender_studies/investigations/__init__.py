"""Investigations of benches that hide something, in virtual time.

| module | holds |
|---|---|
| `virtual_bench` | a hidden bench that plays as fast as it can be computed |
| `trial` | one bench investigated in a process of its own, held to the truth |
| `figures` | the counts of many trials |
"""
