"""From records to evidence: hypotheses of what a model lacks, fitted, searched and judged on blocks not seen.

From top to bottom; each imports only what stands below it.

| module | holds |
|---|---|
| `input_hold` | what the command does between the rows, decided |
| `structures` | linear structures that compete with the effects where no model is given |
| `experiment/` | design of the next experiment |
| `equation/` | a sparse equation for what no effect explains |
| `witnesses/` | what the optional channels of the records testify |
| `search/` | the search for effects and its verdict |
| `candidates` | the forms of effects that a model can have, sized to the records |
| `fitting/` | hypotheses fitted to the records |
| `records/` | records made ready |
| `settings` | how records are read |
"""
