"""Genetic algorithm and particle swarm, and what both begin with.

| module | holds |
|---|---|
| `first_generation` | what swarms and genetic algorithms begin with |
| `ga` | genetic algorithm with real coding |
| `pso` | particle swarm (Kennedy & Eberhart 1995 |
"""
