"""The plant's own step functions compiled over whole records, for fits that need thousands of simulations.

| module | holds |
|---|---|
| `parallel_map` | independent simulations side by side in threads |
| `background_compilation` | kernels compiled in a process beside this one |
| `interrupts` | signals held back while compiled code runs |
| `kernels` | compiled runs of a block over a whole signal, made from the very source of the block |
| `linear_modes` | modes without loads over a whole signal, mode by mode |
| `simulation` | whole records through the compiled chain, equal to the FMU to 1e-9 m |
| `stream` | models driven row by row without end, in memory that does not grow |
| `stored_code` | machine code read from disk without what only compiling needs |
"""
