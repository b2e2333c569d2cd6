"""Devices drawn at random through a first model and a diagnosis.

| module | holds |
|---|---|
| `benchmark` | `bender benchmark fuzz` |
| `campaign` | each device in processes with a time limit, and what should not be |
"""
