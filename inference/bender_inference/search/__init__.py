"""The search for what is missing from a model: one loop, one archive, one score.

| module | holds |
|---|---|
| `search` | the loop: grow, improve, make the case against every effect |
| `moves` | what may change in a hypothesis, each change a small function |
| `explore` | fits of what the moves propose: scanned, roughly, to the end |
| `archive` | every fit once, with what it predicts of blocks that its fit did not see |
| `transfer` | which finalist is carried best to later and larger commands |
| `budget` | how long a search may look |
| `judgement/` | score, rules, grades, verdict |
| `result` | what a search leaves |
| `noise`, `set_aside` | the noise floor; readings that lie beyond it |
| `start`, `full_record` | how a record begins; what excerpts found, on the whole record |
"""
