"""How hypotheses are judged: which predicts better, how sure each effect is, and what is said of all of it.

| module | holds |
|---|---|
| `score` | how far one hypothesis predicts better than another |
| `rules` | the constants that decide |
| `grades`, `probability` | how sure each effect is |
| `verdict` | the contract's word for all of it |
"""
