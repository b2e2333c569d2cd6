"""Where rows come from: files that grow, folders, runs on the bench, standard input.

| module | holds |
|---|---|
| `growing` | a file that grows, and may be replaced |
| `heading` | what the top of a table says |
| `lines` | rows from lines of a table |
| `rows` | a stretch of rows |
| `run` | rows from the journals of a run |
| `sources` | files, folders, runs and standard input, followed or read once |
"""
