"""One controller for a population, over its corrected models.

| module | holds |
|---|---|
| `arguments` | the arguments of `bender fleet tune` |
| `command` | the tuning of a fleet, from its directory to its results |
| `groups` | units that are alike, each group with gains of its own |
| `plants` | the plants of a fleet, opened and linearised once |
| `robust` | a bound on Ms for all units, those that nobody measured among them |
| `search` | gains that serve many plants |
"""
