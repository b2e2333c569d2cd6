"""Export of the plant and of controllers as FMI 2.0 co-simulation FMUs: the only room that knows PythonFMU.

| module | holds |
|---|---|
| `archive` | FMU archives whose bytes depend on their content only |
| `assembly` | the FMUs put together |
| `build` | FMUs on demand: build them, or find that the one that is there is still the right one |
| `content` | what goes into an FMU, and the hash of it |
| `description` | the model description: what FMI 2.0 asks for and PythonFMU does not write |
| `documentation` | the page that an FMU carries: how it is stepped, its equations, its variables |
| `following` | the model-following controller of a tuning as an FMU, and its closed loop |
| `origin` | what an FMU says of its making: the day, its records, the report |
| `packager` | PythonFMU's own part: library, base class and loader information around a slave script |
| `platform_support` | which machines can run the FMUs: PythonFMU ships ready-made libraries for two of them |
| `readme` | the tables of variables in `fmu/README.md`, made from the tables that make the FMUs |
| `system` | the closed loop as an SSP archive (System Structure and Parameterization 1.0) |
| `units` | units as FMI 2.0 wants them: SI base exponents and a factor for every unit string in use |
| `slaves/` | the scripts that run inside the FMUs |
"""
