"""The bench that drives itself: excite, diagnose, play the next experiment, correct, tune again, prove it.

| module | holds |
|---|---|
| `command` | the arguments of `bender investigate` |
| `investigation` | the one way through an investigation, from the noise at rest to the verdict |
| `stage` | plays on a bench, within a budget, each written down before and after; none is played twice |
| `journal` | the decisions, one line of JSON each |
| `bench_port` | what an investigation needs of a bench |
| `real_bench` | the same on a bench file, emulated or not, through the guard |
| `excitation` | voltage profiles for a bench: rest and probe, a first excitation, another one |
| `safety` | what a bench allows, and whether a profile stays within it by every model at hand |
| `proof` | old and new gains on the bench in alternation, and the interval of their difference |
| `retuning` | gains for the corrected model |
| `settings` | what an investigation is asked to do |
| `outcome` | how it ended, as a file and as lines |
"""
