"""The catalogue of effects, and the forms in which a search puts them into a model.

library/     one file per effect: form with bounds and starts, covered and typical sizes, signature, words
effect       what such a file says
form         forms and their free numbers
catalogue    all effects in the order of the chain

| module | holds |
|---|---|
| `catalogue` | the catalogue of effects |
| `checkout` | what `bender effects` writes into a checkout |
| `documents` | the documentation that follows from the catalogue |
| `effect` | one effect of the catalogue |
| `form` | what a search may put into a model: the form of an effect, and its free numbers |
| `rigs` | what kind of device a model is of, as far as the words about effects depend on it |
| `skeleton` | the skeleton of a new effect |
| `witnessed` | what channels beside the readings tell of an effect |
| `lag_taken` | the lag of a plant, taken out for an effect that is that lag with something nonlinear in it |
| `library/` | one file per effect; an effect never imports another one |
"""
