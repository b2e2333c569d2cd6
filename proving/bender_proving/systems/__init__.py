"""Linear systems drawn at random, with records of them: what a first model is judged on.

`linear` draws a system of the first to fourth order with a delay and simulates it by matrix exponentials; `played`
draws what it is driven with.
"""
