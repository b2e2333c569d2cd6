"""One file per command, each with HELP, EXAMPLE, add_arguments and run; heavy imports stay inside run.

| module | holds |
|---|---|
| `bench` | `bender bench check`: the first thing to run on a new bench |
| `benchmark` | `bender benchmark NAME`: the figures that the documentation quotes, measured afresh |
| `cache` | `bender cache`: where built FMUs and compiled code are kept |
| `calibrate` | `bender calibrate`: what a pixel is worth, from pictures of a stage micrometer |
| `calibrate_model` | `bender calibrate-model`: parameters of an FMU from records |
| `compare` | `bender compare RECORD` |
| `completion` | `bender completion SHELL`: the script for a shell |
| `demo` | `bender demo`: the main job, end to end, on what the repository ships |
| `diagnose` | `bender diagnose`: the discrepancy workflow's own command |
| `effects` | `bender effects [ID]` |
| `fleet` | `bender fleet`: many units on a Dask cluster, and records to try it on |
| `fmu` | `bender fmu check FILE` and `bender fmu build`: what is wrong with an FMU, and FMUs of this project |
| `gallery` | `bender gallery`: rigs of other fields, and what the workflow says of each |
| `hil` | `bender hil`: the bench's own command |
| `identify` | `bender identify`: a hysteresis model learned from records |
| `investigate` | `bender investigate`: the bench that drives itself |
| `live` | `bender live RUN`: a past run on the page on which runs are watched |
| `model` | `bender model fit`: a first model from records alone |
| `reproduce` | `bender reproduce`: every number, table and figure of the paper beside ours |
| `simulate` | `bender simulate` |
| `tune` | `bender tune`: the tuner's own command, and the model that it tunes where no FMU is named |
| `watch` | `bender watch`: the model beside the running device |
"""
