"""The PID block: one function that the tuner, the controller FMU and the bench runner all call.

Paper, equation (21), u = Kp e + Ki int(e) + Kd de/dt, with what a real loop needs beside it: the derivative acts on
the measurement through a first-order filter, the output is clamped, and the integral is led back by
back-calculation while it is clamped (Astrom and Hagglund, Advanced PID Control, ISA 2006, sections 3.3 to 3.5).
With `derivative_on_error`, no filter and no limits the block is the printed equation ("paper mode").

Standard library only: the file is carried inside the controller FMU.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class Gains:
    """Parallel gains of equation (21).

    Attributes:
        proportional_V_per_um: Kp.
        integral_V_per_um_s: Ki.
        derivative_V_s_per_um: Kd.
        filter_time_s: time constant of the derivative's first-order filter; 0 is the bare difference quotient.
        derivative_on_error: differentiate the error (the paper) instead of the measurement.

    Raises:
        ValueError: a gain is negative or not finite, or the filter time is.
    """

    proportional_V_per_um: float
    integral_V_per_um_s: float
    derivative_V_s_per_um: float = 0.0
    filter_time_s: float = 0.0
    derivative_on_error: bool = False

    def __post_init__(self) -> None:
        for name in ("proportional_V_per_um", "integral_V_per_um_s", "derivative_V_s_per_um", "filter_time_s"):
            value = getattr(self, name)
            if not math.isfinite(value) or value < 0.0:
                raise ValueError(f"{name} must be a finite number >= 0, found {value!r}")


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds of the command and how fast the integral yields to them.

    Attributes:
        lower_V: smallest command, -inf for none.
        upper_V: largest command, inf for none.
        tracking_time_s: time constant of the back-calculation; 0 leads the integral back within one step.

    Raises:
        ValueError: the bounds cross or are NaN, or the tracking time is negative.
    """

    lower_V: float = 0.0
    upper_V: float = 50.0
    tracking_time_s: float = 0.0

    def __post_init__(self) -> None:
        if not self.lower_V < self.upper_V:
            raise ValueError(f"lower_V must lie below upper_V, found {self.lower_V!r} and {self.upper_V!r}")
        if not math.isfinite(self.tracking_time_s) or self.tracking_time_s < 0.0:
            raise ValueError(f"tracking_time_s must be a finite number >= 0, found {self.tracking_time_s!r}")


UNLIMITED = Limits(lower_V=-math.inf, upper_V=math.inf)


class PidState(NamedTuple):
    """What the block remembers from one step to the next.

    `previous_um` is NaN before the first step: the first derivative is then zero, not a jump from nothing.
    """

    integral_V: float = 0.0
    derivative_V: float = 0.0
    previous_um: float = math.nan


def step(
    gains: Gains, limits: Limits, state: PidState, setpoint_um: float, measurement_um: float, dt_s: float
) -> tuple[PidState, float]:
    """Advance the controller by one sample; returns (state, command_V).

    The error is integrated before it is used (backward Euler), the derivative is filtered by
    D+ = (Tf D - Kd dx) / (Tf + dt). After clamping, the integral moves by (clamped - raw) dt / (Tt + dt).
    The caller guarantees dt_s > 0 and finite signals.
    """
    error = setpoint_um - measurement_um
    signal = error if gains.derivative_on_error else -measurement_um
    change = signal - state.previous_um
    if change != change:
        change = 0.0
    filter_time = gains.filter_time_s
    derivative = (filter_time * state.derivative_V + gains.derivative_V_s_per_um * change) / (filter_time + dt_s)
    integral = state.integral_V + gains.integral_V_per_um_s * error * dt_s
    raw = gains.proportional_V_per_um * error + integral + derivative
    command = limits.lower_V if raw < limits.lower_V else limits.upper_V if raw > limits.upper_V else raw
    if command != raw:
        integral += (command - raw) * dt_s / (limits.tracking_time_s + dt_s)
    return PidState(integral, derivative, signal), command


def limits_at(limits: Limits, previous_V: float, change_V: float, feedforward_V: float = 0.0) -> Limits:
    """Limits of the controller's own output at one tick.

    They are those of the command, narrowed to `previous_V` +- `change_V` and moved by the feedforward voltage.
    `previous_V` must lie within `limits`.
    """
    lower = max(limits.lower_V, previous_V - change_V) - feedforward_V
    upper = min(limits.upper_V, previous_V + change_V) - feedforward_V
    return Limits(lower, upper, limits.tracking_time_s)
