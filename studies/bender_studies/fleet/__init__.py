"""What a fleet costs, and whether it names what its example hides.

| module | holds |
|---|---|
| `benchmark` | `bender benchmark fleet` |
| `names` | the example of a fleet diagnosed and held to its truth |
| `speed` | workers against one worker, and a unit in a fleet against the same diagnosis alone |
| `tuning` | one controller for the fleet against one tuned on the nominal model |
"""
