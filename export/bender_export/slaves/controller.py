"""The PID block as an FMI slave: one communication step is one sample of the controller.

The builder copies this file under a content-hashed name, renames the modules that it imports likewise and fills in the
start values of a tuning, as JSON by the names of `TABLE`. The command
is worked out at the end of the step from the inputs that stood before it, with the step's length as sampling time.
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from bender_export.slaves.shell import Row, Shell
from bender_loop.control.pid import Gains, Limits, PidState, step

IDENTITY = "PidController"
START_JSON = "{}"
UNITS_JSON = '["V", "um"]'
"""Of command and reading, which V and um of the gains stand for."""

_LIMITS = Limits()
TABLE = (
    Row("setpoint", "input", "continuous", "m", 0.0, -math.inf, math.inf, "displacement that is asked for"),
    Row("measurement", "input", "continuous", "m", 0.0, -math.inf, math.inf, "displacement that the sensor reads"),
    Row("command", "output", "discrete", "V", 0.0, -math.inf, math.inf, "voltage for the plant"),
    Row("gains.proportional", "parameter", "tunable", "V/um", 0.0, 0.0, 1e9, "Kp of equation (21)"),
    # slow enough for the built-in plants at any sampling up to a few frames of latency, until a tuning replaces it
    Row("gains.integral", "parameter", "tunable", "V/(um.s)", 5.0, 0.0, 1e9, "Ki of equation (21)"),
    Row("gains.derivative", "parameter", "tunable", "V.s/um", 0.0, 0.0, 1e9, "Kd of equation (21)"),
    Row(
        "gains.filter_time", "parameter", "tunable", "s", 0.0, 0.0, 1e3,
        "time constant of the derivative's filter, 0 for the bare difference quotient",
    ),
    Row(
        "gains.derivative_on_error", "parameter", "tunable", "1", False, False, True,
        "differentiate the error (as the paper does) instead of the measurement",
    ),
    Row("limits.lower", "parameter", "tunable", "V", _LIMITS.lower_V, -math.inf, math.inf, "smallest command"),
    Row("limits.upper", "parameter", "tunable", "V", _LIMITS.upper_V, -math.inf, math.inf, "largest command"),
    Row(
        "limits.tracking_time", "parameter", "tunable", "s", _LIMITS.tracking_time_s, 0.0, 1e6,
        "time constant of the anti-windup, 0 leads the integral back within one step",
    ),
)  # fmt: skip
_COMMAND = 2
_FIRST_LIMIT = 8


def table_of(start: Mapping[str, float], units: Sequence[str] = ("V", "um")) -> tuple[Row, ...]:
    """Return the variables with these start values in place of those of `TABLE`.

    Args:
        start: values by name.
        units: of command and reading; others than V and um stand in their places, and in that of m.
    """
    table = tuple(row._replace(start=start.get(row.name, row.start)) for row in TABLE)
    return table if tuple(units) == ("V", "um") else tuple(_in_units(row, units) for row in table)


def _in_units(row: Row, units: Sequence[str]) -> Row:
    own = {"V": units[0], "um": units[1], "m": units[1]}
    whole = row.unit in own
    parts = [own.get(x, x) if whole or x not in own else _bracketed(own[x]) for x in re.split(r"(\W)", row.unit)]
    text = row.description.replace("displacement", "reading").replace("voltage", "command")
    return row._replace(unit="".join(parts), description=text)


def _bracketed(unit: str) -> str:
    return unit if unit.isalpha() else f"({unit})"


class PidController(Shell):
    """The PID block of equation (21) over FMI: metres in, volts out."""

    IDENTITY = IDENTITY

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(table_of(json.loads(START_JSON), json.loads(UNITS_JSON)), **kwargs)
        self.block: tuple[Gains, Limits] | None = None
        self.rest()

    def rest(self) -> None:
        """Forget the past; before the first sample the command is the one nearest to 0 V."""
        limits = self.checked_block()[1]
        self.memory = PidState()
        self.values[_COMMAND] = min(max(0.0, limits.lower_V), limits.upper_V)

    def recalled(self, memory: tuple[float, ...]) -> PidState:
        """Return the state of the PID block from its plain numbers."""
        return PidState(*memory)

    def parameters_changed(self) -> None:
        """Take the gains and limits anew at the next sample."""
        self.block = None

    def checked_block(self) -> tuple[Gains, Limits]:
        """Return gains and limits.

        Raises:
            ValueError: limits that are right one by one cross.
        """
        if self.block is None:
            gains = Gains(*self.values[_COMMAND + 1 : _FIRST_LIMIT])
            self.block = gains, Limits(*self.values[_FIRST_LIMIT:])
        return self.block

    def step(self, current_time: float, step_size: float) -> None:
        """Take one sample of the controller."""
        del current_time
        if not 0.0 < step_size < math.inf:
            raise ValueError(f"found a step of {step_size!r} s, expected more than 0")
        values = self.values
        gains, limits = self.block or self.checked_block()
        memory, command = step(gains, limits, self.memory, 1e6 * values[0], 1e6 * values[1], step_size)
        if not (math.isfinite(command) and math.isfinite(memory.integral_V) and math.isfinite(memory.derivative_V)):
            raise ArithmeticError(
                f"found a command of {command!r} V from setpoint {values[0]!r} m and measurement {values[1]!r} m, "
                "expected a finite one"
            )
        self.memory, values[_COMMAND] = memory, command
