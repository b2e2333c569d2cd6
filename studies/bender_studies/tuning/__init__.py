"""What the searches are worth, and what an evaluation costs: the figures that the documentation quotes.

`study` runs every method on two plants against an optimum found in the same run; `speed` holds the loop against the
bare FMU calls and against a tuning written with `simulate_fmu`. Both get the FMU files from their caller.
"""
