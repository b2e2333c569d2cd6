"""The benchmarks behind `bender benchmark`, one command each; they are listed in `bender_cli.commands.benchmark`.

| module | measures |
|---|---|
| `discrepancy` | how often `bender diagnose` finds what is hidden |
| `diagnose`, `diagnose_runs` | what a diagnosis costs |
| `tuner`, `speed` | optimisers against the optimum; what an evaluation and a start cost |
| `identify`, `identify_claims` | the claims of `bender identify` |
| `control` | what a controller that uses the diagnosed model is worth |
| `hil`, `vision` | the bench: cadence, faults, sub-pixel accuracy |

| module | holds |
|---|---|
| `benches` | `bender benchmark benches`: five kinds of benches by every command, from the check to the diagnosis |
| `control` | `bender benchmark control`: hidden benches, diagnosed, then run with and without the corrected model |
| `records_at_hand` | which rigs, devices or benchmarks a command was asked for, and where their records are |
| `devices` | `bender benchmark devices`: other people's devices from their records alone |
| `diagnose` | `bender benchmark diagnose` |
| `diagnose_runs` | records to time `bender diagnose` on, and runs of it in processes of their own |
| `discrepancy` | `bender benchmark discrepancy` |
| `first_model` | `bender benchmark model` |
| `hil` | `bender benchmark hil` |
| `identify` | `bender benchmark identify`: what the identification is held to, claim by claim |
| `identify_claims` | what `bender identify` is held to, claim by claim, computed afresh |
| `investigate` | `bender benchmark investigate`: hidden benches in virtual time; one killed and resumed |
| `nonlinear` | `bender benchmark nonlinear`: the public nonlinear benchmarks, with their official splits |
| `probabilities` | `bender benchmark probabilities`: how well the probabilities of diagnoses are kept |
| `second_record` | what a model leaves of a record that it was not fitted to |
| `speed` | `bender benchmark speed` |
| `tuner` | `bender benchmark tuner`: every method on two plants, against the optimum |
| `vision` | `bender benchmark vision` |
"""
