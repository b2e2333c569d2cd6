"""How well a watch does: false alarms, delay against the optimal test, the right effect, beside other detectors.

| module | holds |
|---|---|
| `benchmark` | `bender benchmark watch` |
| `devices` | hidden devices whose effects come in while they are watched |
| `others` | other detectors on the same whitened residual |
| `short` | many short records of devices whose past nobody knows |
| `side_by_side` | all of them at equal false alarms |
| `trial` | one device watched, and what the optimal test would have done |
"""
