"""What `bender reproduce` does: every number, table and figure of the paper beside ours, computed in that run.

One file for each exhibit, with a function `show(workshop) -> Exhibit`; `registry` lists them. `printed` holds what the
paper prints, with its place, and those are the only constants that come from outside; `workshop` holds what several
exhibits need, computed once; `bench` runs what the paper did on its bench.
"""
