"""FMUs without Python: the plain kernels of the plant and of the PID block, translated to C99.

The kernels are not edited and no equation is written a second time: `staging` runs the Python functions with the
structure of a model known and its numbers unknown, and writes C for what depends on the unknown numbers.

| module | holds |
|---|---|
| `build` | FMUs without Python |
| `compilers` | C compilers: `ziglang` for every platform where it is installed |
| `container` | anybody's FMU between stages of ours, as one FMU |
| `description` | the model descriptions of FMUs without Python, from the same tables as those of PythonFMU |
| `following_source` | the model-following controller in C |
| `foreign` | other makers' sources, compiled on request |
| `lacking` | models without one of their effects |
| `linearise` | a linear model of the plant at an operating point |
| `model_source` | the C source of a model |
| `plant_source` | the plant in C |
| `ready` | the plant FMU that the commands run |
| `slave_source` | small slaves in C |
| `staging/` | the staging translator |
"""
