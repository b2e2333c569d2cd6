"""The search for missing effects: beam, single steps, revision, evidence, verdict.

| module | holds |
|---|---|
| `beam` | the search for missing effects |
| `budget` | how much is computed, in one place |
| `certain` | only what is certain stands beside others |
| `evidence` | the few constants that decide what is said, and their tests; flexible forms against simple ones |
| `full_record` | what was found in excerpts |
| `own_alone` | the model's own linear numbers by themselves, in the place of effects and beside them |
| `result` | what a search and its verdict leave: the state from which everything that is told is made |
| `revise` | early choices looked at again beside a later effect |
| `set_aside` | readings set aside by what a hypothesis leaves, and everything counted anew without them |
| `start` | how a record begins, weighed with what a search has found |
| `state` | what a search found, and how large what it leaves is; coarse readings as they are |
| `step` | one step of the search |
| `together` | several more effects at once, where none is certain before the others are there |
| `verdict` | what may be said: named, ambiguous, unexplained, recalibrated or no gap, and on what evidence |
"""
