"""Linear systems drawn at random, with records of them: what a first model is judged on.

`linear` draws a system of the first to fourth order with a delay and simulates it by matrix exponentials; `played`
draws what it is driven with; `suspected` draws a model of which a number is off, or an effect is missing.

| module | holds |
|---|---|
| `linear` | linear systems of the first to fourth order behind a delay, and their answer to a held input |
| `played` | what a drawn system is driven with |
| `suspected` | a lag or a mode whose number is off, whose model lacks an effect, or both |
"""
