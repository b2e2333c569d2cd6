"""What `bender reproduce` does: every number, table and figure of the paper beside ours, computed in that run.

| module | holds |
|---|---|
| `run` | the command: exhibits computed one after the other, page, JSON and pictures |
| `registry` | the exhibits in the order of the paper |
| `exhibits/` | one file for each exhibit, with a function `show(shared) -> Exhibit` |
| `exhibit` | what an exhibit is: rows of the paper's number, the paper's way, and ours |
| `printed` | what the paper prints, with its place: the only constants that come from outside |
| `shared_work` | what several exhibits need, computed once |
| `steps`, `searches` | tunings and searches that exhibits share |
| `bench`, `emulated` | the paper's experiments, on the emulated bench |
| `plain_regression` | sparse regression as the paper did it |
| `document`, `story` | the exhibits as data and as sections of the page |
"""
