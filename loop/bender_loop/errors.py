"""The two ways in which a command fails, distinguished by their exit status."""


class InputError(ValueError):
    """Bad usage or bad input (exit status 2): the message is one line with what was found, where, and what to do."""


class RunError(Exception):
    """The run itself failed (exit status 1): the message is one line with what happened and the next step."""
