"""The benchmarks behind `bender benchmark`, one command each; they are listed in `bender_cli.commands.benchmark`.

| module | measures |
|---|---|
| `discrepancy` | how often `bender diagnose` finds what is hidden |
| `diagnose`, `diagnose_runs` | what a diagnosis costs |
| `tuner`, `speed` | optimisers against the optimum; what an evaluation and a start cost |
| `identify`, `identify_claims` | the claims of `bender identify` |
| `hil`, `vision` | the bench: cadence, faults, sub-pixel accuracy |
| `fuzz` | hostile input |
"""
