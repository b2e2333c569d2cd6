"""Genetic algorithm and particle swarm, and what both begin with."""
