"""The command line: it reads arguments, calls the rooms below and turns their failures into exit statuses.

| module | holds |
|---|---|
| `working_folder` | on import, the working folder is forgotten: none of its modules is loaded |
| `start` | what makes a process ready before anything else is imported |
| `main` | `bender COMMAND ...`: find the command, read its arguments, map every failure to an exit status |
| `commands/` | one file per command, each with HELP, EXAMPLE, add_arguments and run |
"""
