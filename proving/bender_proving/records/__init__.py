"""What is played to a hidden bench and read from it.

| module | holds |
|---|---|
| `excitation` | what is played to a bench: when rows are read, what is commanded, when the command acts |
| `excitations` | the excitations of the records |
| `frames` | frames that went wrong |
"""
