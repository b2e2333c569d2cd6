"""The command line: it reads arguments, calls the rooms below and turns their failures into exit statuses.

| module | holds |
|---|---|
| `start` | what makes a process ready before anything else is imported |
| `main` | `bender COMMAND ...`: find the command, read its arguments, map every failure to an exit status |
| `commands/` | one file per command, each with HELP, EXAMPLE, add_arguments and run |
"""
