"""What a search found, made into numbers, notes, sentences, the corrected model, the gap and `diagnosis.json`.

| module | holds |
|---|---|
| `findings` | what is told: the final verdict, effects with numbers, what was recalibrated, the corrected model |
| `contenders` | the effects that are reported, each with its share of the gap and its rivals |
| `shares` | which part of the gap each effect closes, on rows that nothing saw |
| `numbers` | the numbers of an effect as its block bears them, with standard deviations |
| `origin` | of which records the corrected model is, and what was learned from them |
| `coarse_readings` | the steps of the sensor, read off the record |
| `measurement/` | the corrected model, its FMU driven, the gap |
| `localise` | where the residual lives |
| `smallest_visible` | the smallest size of every effect that the records would have shown |
| `notes`, `sentences` | warnings and sentences |
| `diagnosis_json` | the content of `diagnosis.json` |
| `partial` | what is kept of an interrupted diagnosis |
"""
