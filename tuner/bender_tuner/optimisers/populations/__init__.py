"""Genetic algorithm and particle swarm of pymoo, asked for one point at a time."""
