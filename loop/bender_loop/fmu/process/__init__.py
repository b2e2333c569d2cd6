"""An FMU in a process of its own: `watched`, the plant that is asked; `worker`, the process that answers."""
