"""The staging translator: plain Python functions run with some numbers unknown, and the C99 that is left of them.

| module | holds |
|---|---|
| `arithmetic` | arithmetic on numbers that are known at run time only |
| `calls` | calls: what is known is called |
| `context` | what is being written |
| `expressions` | expressions of Python, evaluated as far as they are known and written as C for the rest |
| `library` | Python's own functions on numbers that are known at run time only |
| `rings` | lists of a length that is known at run time only |
| `statements` | statements of Python: branches, loops, returns and refusals |
| `values` | what the translator computes with |
"""
