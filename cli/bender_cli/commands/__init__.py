"""One file for each command that no room has whole: HELP, EXAMPLE, add_arguments and run; heavy imports stay in run.

| module | holds |
|---|---|
| `bench` | `bender bench check`: the first thing to run on a new bench |
| `benchmark` | `bender benchmark NAME`: the figures that the documentation quotes, measured afresh |
| `cache` | `bender cache`: where built FMUs and compiled code are kept |
| `compare` | `bender compare RECORD` |
| `completion` | `bender completion SHELL`: the script for a shell |
| `effects` | `bender effects [ID]` |
| `fleet` | `bender fleet`: many units on a Dask cluster, and records to try it on |
| `fmu` | `bender fmu check FILE` and `bender fmu build`: what is wrong with an FMU, and FMUs of this project |
| `hil` | `bender hil`: the bench's own command |
| `model` | `bender model fit`: a first model from records alone |
| `reproduce` | `bender reproduce`: every number, table and figure of the paper beside ours |
| `simulate` | `bender simulate` |
| `tune` | `bender tune`: the tuner's own command, and the model that it tunes where no FMU is named |
"""
