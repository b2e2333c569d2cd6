"""Beetle antennae search: as the paper prints it, as Jiang and Li describe it, and a reliable variant.

| module | holds |
|---|---|
| `bas` | beetle antennae search with its sign corrected, and otherwise unchanged |
| `bas_printed` | beetle antennae search exactly as printed ("paper mode"), to show what it does: it climbs |
| `reliable_bas` | our reliable beetle |
"""
