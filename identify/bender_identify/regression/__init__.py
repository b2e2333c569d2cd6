"""Sparse regression: terms, rates, supports, the learned equation.

| module | holds |
|---|---|
| `equation_search` | the learned equation: supports from sparse regression, each judged and refined by simulation |
| `plain_sindy` | sparse regression as a package gives it by default |
| `rates` | the regression behind SINDy: rates of the displacement against candidate terms, strong or weak |
| `sparse_fit` | sparse supports by PySINDy's optimisers |
| `terms` | terms of the learned equation on arrays, in words, and as a library of PySINDy |
"""
