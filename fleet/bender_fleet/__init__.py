"""Fleets: the same work over the records of many units, on a cluster that exists.

| module | holds |
|---|---|
| `command` | `bender fleet`: arguments, and what each action does with them |
| `asked` | what a command asks of every unit, and the work that follows |
| `on_demand` | report pages of single units, drawn when somebody asks |
| `run` | one run over a fleet: plan, schedule, merge, page |
| `sources/` | which units there are, where their records lie, and keys made of their content |
| `work/` | what is done with one unit in a worker: diagnose, compare, identify |
| `cluster/` | the Dask cluster: one on this machine or one that runs, and how units are handed to it |
| `results/` | rows and files of a unit, written whole or not at all, and the tables made of them |
| `population/` | what the units say together: frequencies, distributions, outliers, trends, the next experiment |
| `page/` | the page of a fleet, one HTML file |
| `tuning/` | one controller for a population, over its corrected models |
"""
