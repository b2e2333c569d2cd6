"""The catalogue of effects, and the forms in which a search puts them into a model.

library/     one file per effect: form with bounds and starts, covered and typical sizes, signature, words
effect       what such a file says
form         forms and their free numbers
catalogue    all effects in the order of the chain
"""
