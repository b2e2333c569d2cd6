"""What a controller that uses the corrected model is worth on hidden benches: `bender benchmark control`.

| module | holds |
|---|---|
| `figures` | the table of the benches, and whether they keep the bounds |
| `hidden_loop` | a hidden bench in a closed loop, in virtual time |
| `learned` | a scan that repeats, learned from pass to pass |
| `spread` | devices that are not what was diagnosed, and whether a loop on them is stable |
| `trial` | one bench: recorded, diagnosed, tuned, and run with and without the model |
"""
