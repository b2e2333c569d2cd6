"""The piezo bending actuator: composite beam, hysteresis and the chain of blocks between command and reading.

Standard library only, relative imports only: the package is carried whole inside every plant FMU.
"""
