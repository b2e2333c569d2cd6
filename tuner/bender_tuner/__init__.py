"""Tuning of the PID block against any plant: search spaces, design rules, objectives, analysis, gain export.

| module | holds |
|---|---|
| `command` | `bender tune`: the PID block tuned against any FMI 2.0 co-simulation FMU with one input and one output |
| `model/` | models of the plant for tuning: linear, sampled, reduced; margins, ensembles, Monte Carlo |
| `optimisers/` | optimisers with ask and tell |
| `pictures/` | pictures of a tuning |
| `results/` | what a tuning leaves: gains file, tuning file, summary, robustness report |
| `rules/` | tuning rules in closed form, and gains in the forms of other controllers |
| `task/` | what is tuned: settings, search space, experiment, objectives, and the methods at work |
"""
