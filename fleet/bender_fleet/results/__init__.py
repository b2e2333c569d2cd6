"""What a fleet writes: parts by the workers, tables made of them.

| module | holds |
|---|---|
| `columns` | the columns of the tables, by what was done |
| `folder` | the output directory: whose it is, and what an earlier run left |
| `parts` | the result of one unit, written whole or not at all |
| `tables` | the tables of units and effects, made of the parts |
"""
