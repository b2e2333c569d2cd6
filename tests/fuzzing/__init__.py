"""Inputs that nobody would send on purpose, by the thousand: values, steps, legal call orders, damaged archives.

| module | holds |
|---|---|
| `apart` | cases in a process of their own |
| `calls` | legal call orders of FMI 2.0 with illegal values |
| `commands` | `bender fmu check` and `bender tune` on a damaged FMU: an exit status and sentences, never more |
| `hostile_campaign` | bad inputs through whole commands |
| `hostile_commands` | strange files for every command that reads one |
| `hostile_files` | files that nobody would give on purpose |
| `hostile_words` | command lines with something wrong in them |
| `mutations` | damaged FMUs: bytes of the archive |
| `strange_tables`, `table_reading` | records in the formats of other programs, sound and damaged, and their reading |
| `__main__` | `python -m fuzzing --inputs 1000 --seed 7` |
| `program` | the installed `bender`, found by its entry point: what is attacked is the program, whole |
"""
