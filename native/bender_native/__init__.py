"""FMUs without Python: the plain kernels of the plant and of the PID block, translated to C99.

The kernels are not edited and no equation is written a second time: `staging` runs the Python functions with the
structure of a model known and its numbers unknown, and writes C for what depends on the unknown numbers.
"""
