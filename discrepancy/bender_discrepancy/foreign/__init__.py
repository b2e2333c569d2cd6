"""The diagnosis of anybody's FMU.

| module | holds |
|---|---|
| `diagnose` | the one way through: another model takes the FMU's place while effects are fitted |
| `surrogate` | that model: linear, or with a relaxation that bends |
| `slow_copy` | a slow part beside the quick one: a zero between its poles |
| `relaxation_model` | the latter, fitted to runs of the FMU |
| `container_stages` | the corrected FMU: what of a corrected stand-in stands before, beside or behind the original |
| `corrected_fmu` | the corrected FMU, made and driven |
| `space_mapping` | an FMU that is not linear, followed to what was found; the gap, measured on the corrected FMU |
| `answers` | the FMU with corrections around it, driven once for each command, without a container |
| `suspects` | parameters of the FMU that may be off: which, and how far they may go |
| `calibration` | parameters fitted by the FMU itself: sensitivities first |
| `calibrate_command` | `bender calibrate-model` |
| `competition` | parameters of the FMU against missing effects, by the same evidence |
| `shared_parameters` | suspected parameters of several outputs: one value, fitted to all of them |
| `outputs` | several outputs: each by itself, and all together |
| `joint_explanations` | the ways to explain several outputs, weighed by one likelihood |
| `outputs_report` | what several outputs say, in a sentence, a table and a page |
| `outputs_command` | `bender diagnose` with several outputs |
"""
