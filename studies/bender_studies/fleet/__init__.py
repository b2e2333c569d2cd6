"""What a fleet costs, and whether it names what its example hides.

| module | holds |
|---|---|
| `benchmark` | `bender benchmark fleet` |
| `names` | the example of a fleet diagnosed and held to its truth |
| `scheduling` | thousands of units that only sleep: cost of a unit, memory, page |
| `speed` | workers against one worker, and a unit in a fleet against the same diagnosis alone |
| `stand_in` | units that sleep and then say something like a diagnosis |
| `tuning` | one controller for the fleet against one tuned on the nominal model |
"""
