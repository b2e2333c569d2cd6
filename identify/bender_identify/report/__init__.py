"""What an identification tells.

| module | holds |
|---|---|
| `files` | what is written: the model file with report, picture and figures |
| `figures` | the outcome as data for JSON and as lines of a table |
| `remarks` | sentences of warning |
| `loops` | the picture of the loops |
| `page` | the page, made by `bender_report` |
"""
