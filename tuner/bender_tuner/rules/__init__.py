"""Tuning rules in closed form, and gains in the forms of other controllers.

| module | holds |
|---|---|
| `gain_forms` | one set of gains in the forms that other controllers expect |
| `simc` | SIMC and improved SIMC gains in closed form, and the first guess of a search |
| `ziegler_nichols` | Ziegler and Nichols' rule from the ultimate point |
"""
