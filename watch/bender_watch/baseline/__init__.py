"""What is normal: the model's expectation, the noise of a training record, and what each effect would add.

| module | holds |
|---|---|
| `beginning` | what came before a record |
| `candidates` | effects of the catalogue as small changes of a model |
| `courses` | a device on other courses than the expected one, until what they add has faded |
| `drift` | level and gain along straight lines of time, that are followed |
| `expectation` | expected readings and signatures, row by row: of a model, of an FMU |
| `learn` | from a model and its training record to a baseline |
| `noise` | the noise of a residual, whitened: predictors of every order |
| `pause` | ways of the command where rows are missing |
| `place` | where a device was before the first row |
| `signatures` | which signatures are told apart on a training record |
"""
