"""The scripts that run inside the FMUs.

They are ordinary modules here, so that they are checked like any other code; the builder copies them into the FMU
under content-hashed names, with the packages that they import.
"""
