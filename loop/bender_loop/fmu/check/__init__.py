"""Every check at hand on any FMU: archive, schema, rules of the standard that schemas cannot state, a trial run.

| module | holds |
|---|---|
| `archive` | rules for the archive (FMI 2.0, section 2.3): names, integrity, binaries, documentation |
| `check` | all checks of an FMU, one after the other |
| `description` | rules for the model description that neither the schema nor the usual checkers know (FMI 2.0 |
| `explanations` | error messages of FMUs and their loaders that people meet, with what they mean |
| `findings` | what a check found, why it matters and what to do about it |
| `standard` | the checkers of others |
| `trial` | the trial run of an FMU, as a process of its own |
| `trial_instance` | one instance of an FMU with all its Real inputs moved alike and all its Real outputs read |
| `trial_process` | the trial run from outside |
"""
