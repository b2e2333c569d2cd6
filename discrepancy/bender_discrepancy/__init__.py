"""Where simulation and measurement disagree, which effect is missing, how sure that is, and the corrected model.

From top to bottom; each imports only what stands below it.

| module | holds |
|---|---|
| `command` | `bender diagnose`: arguments, progress, what is kept after an interrupt |
| `foreign` | the diagnosis of anybody's FMU |
| `workflow` | the one way through: read, search, judge, measure, propose |
| `record_search` | the search of the records of one bench: beginning, forms, judgement |
| `structures` | linear structures that compete with the effects where no model is given |
| `input_hold` | what the command does between the rows, decided |
| `diagnosis` | the frozen result: final verdict, effects, gap, next experiment, corrected model |
| `rivals` | the models that the records leave open beside the corrected one |
| `report/` | page, summary on the terminal, pictures |
| `conclusion/` | numbers, notes and sentences, the gap through the FMU, `diagnosis.json` |
| `experiment/` | design of the next experiment |
| `equation/` | a sparse equation for what no effect explains |
| `witnesses/` | what the optional channels of the records testify |
| `search/` | the search for effects and its verdict |
| `candidates` | the forms of effects that a model can have, sized to the records |
| `fitting/` | hypotheses fitted to the records |
| `records/` | records made ready |
| `effects/` | the catalogue |
| `settings` | how records are read |
| `output_folder` | a directory whose files appear all together |
| `pickling` | pickles of results that hold functions made inside of functions |
"""
