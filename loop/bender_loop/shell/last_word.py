"""The last word of a command: whether an output that it had switched on is known to be off.

Every output that this process has switched on stands here from before it can be on until the guard has confirmed that
it is off. The command line asks once, after everything else: where an output is not confirmed off, the alarm is the
last line on the standard error and the exit status is `UNCONFIRMED`, whatever the command itself came to. A disk that
is full, a standard output that is closed or a process without memory changes nothing of that.
"""

import os
import sys

UNKNOWN = "OUTPUT STATE UNKNOWN: press OUTPUT OFF at the front panel of the source, or unplug it"
UNCONFIRMED = 3
_IN_BYTES = f"bender: {UNKNOWN}\n".encode("ascii")
_STANDARD_ERROR = 2


class Output:
    """An output that may be on from now; made before anything is switched.

    Attributes:
        alarm: what to say of it as it stands, empty for an output that is off.
    """

    __slots__ = ("alarm",)

    def __init__(self) -> None:
        self.alarm = UNKNOWN
        _outputs.append(self)

    def confirm_off(self) -> None:
        """Take the guard's word that it is off, or that it was never switched on."""
        self.alarm = ""


_outputs: list[Output] = []


def number_of_outputs() -> int:
    """Return how many outputs this process has switched on so far."""
    return len(_outputs)


def status_at_last(status: int, since: int = 0) -> int:
    """Return the exit status of a command, and say the alarm where one stands. Never raises.

    Args:
        status: that the command itself came to.
        since: `number_of_outputs` before the command.
    """
    alarm = ""
    for output in _outputs[since:]:
        alarm = alarm or output.alarm
    if not alarm:
        return status
    _say(alarm)
    return UNCONFIRMED


def _say(alarm: str) -> None:
    try:
        sys.stderr.write(f"bender: {alarm}\n")
        sys.stderr.flush()
    except BaseException:  # whatever it is, there is nobody else to say it
        try:
            os.write(_STANDARD_ERROR, _IN_BYTES)
        except BaseException:  # nobody listens; the exit status is left
            return
