"""Where simulation and measurement disagree, which effect is missing, how sure that is, and the corrected model.

From top to bottom; each imports only what stands below it.

| module | holds |
|---|---|
| `command` | `bender diagnose`: arguments, progress, what is kept after an interrupt |
| `foreign` | the diagnosis of anybody's FMU |
| `workflow` | the one way through: read, search, judge, measure, propose |
| `record_search` | the search of the records of one bench: beginning, forms, judgement |
| `diagnosis` | the frozen result: final verdict, effects, gap, next experiment, corrected model |
| `rivals` | the models that the records leave open beside the corrected one |
| `report/` | page, summary on the terminal, pictures |
| `conclusion/` | numbers, notes and sentences, the gap through the FMU, `diagnosis.json` |
| `output_folder` | a directory whose files appear all together |
| `pickling` | pickles of results that hold functions made inside of functions |
"""
