"""What an alarm says: since when, which effect, how large, what it does to the loop, what to do.

| module | holds |
|---|---|
| `evidence` | what the last rows say of a change |
| `explain` | the diagnosis of the rows since a change, the old model as its base |
| `history` | the last rows, as many as are kept |
| `loop_effect` | what a change does to the loop of the present gains |
| `onset` | since when, how large, and whether it grows |
| `still` | a reading that does not move, or does not come |
| `suspects` | the signatures that explain a change, beside level and gain |
"""
