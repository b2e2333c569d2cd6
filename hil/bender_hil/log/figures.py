"""What a run says about the actuator: the step response of a closed loop, the two lines of a staircase."""

from dataclasses import dataclass

import numpy as np

from bender_loop.control.metrics import StepMetrics, step_metrics
from bender_loop.control.trace import Trace
from bender_loop.records.acting_voltage import acting_V
from bender_loop.records.record import Array, Record

PAPER_SENSITIVITY_UM_PER_V, PAPER_R2_UP, PAPER_R2_DOWN = 0.473, 0.99, 0.98
"""What Musa and Wejinya give for their actuator, section V, Figure 8."""

_SETTLED_SHARE = 0.3
_FEWEST_LEVELS = 5


@dataclass(frozen=True, slots=True)
class Line:
    """Least squares through the settled readings of one branch.

    Attributes:
        sensitivity_um_per_V: its slope.
        r_squared: coefficient of determination.
        levels: how many voltages.
    """

    sensitivity_um_per_V: float
    r_squared: float
    levels: int


@dataclass(frozen=True, slots=True)
class Staircase:
    """Both branches, and the widest gap between them at one voltage."""

    up: Line
    down: Line
    loop_width_um: float


def step_figures(record: Record) -> StepMetrics | None:
    """Figures of a run whose setpoint is one step; None for any other."""
    setpoint = record.setpoint_um
    seen = np.isfinite(record.displacement_um)
    if setpoint is None or np.ptp(setpoint) != 0.0 or np.count_nonzero(seen) < 2:
        return None
    time_s, displacement_um = record.time_s[seen], record.displacement_um[seen]
    if setpoint[0] == displacement_um[0]:
        return None
    trace = Trace(time_s, setpoint[seen], displacement_um, displacement_um, record.voltage_V[seen])
    return step_metrics(trace)


def staircase_figures(record: Record) -> Staircase | None:
    """Figures of a run that goes up by levels and down again; None for any other."""
    voltage_V, displacement_um = settled_levels(record)
    if len(voltage_V) < 2 * _FEWEST_LEVELS:
        return None
    top = int(np.argmax(voltage_V))
    up, down = slice(0, top + 1), slice(top, None)
    rises, falls = np.diff(voltage_V[up]), np.diff(voltage_V[down])
    if min(len(rises), len(falls)) < _FEWEST_LEVELS - 1 or not (np.all(rises > 0.0) and np.all(falls < 0.0)):
        return None
    shared = np.linspace(max(voltage_V[0], voltage_V[-1]), voltage_V[top], 201)
    rising = np.interp(shared, voltage_V[up], displacement_um[up])
    falling = np.interp(shared, voltage_V[down][::-1], displacement_um[down][::-1])
    return Staircase(
        _line(voltage_V[up], displacement_um[up]),
        _line(voltage_V[down], displacement_um[down]),
        float(np.max(np.abs(rising - falling))),
    )


def settled_levels(record: Record) -> tuple[Array, Array]:
    """Each stretch of constant voltage, and the mean of what was read in its last part."""
    # row k is read before its own voltage acts: it belongs to the voltage of the row before
    volts = acting_V(record.time_s, record.time_s, record.voltage_V)
    edges = np.flatnonzero(np.diff(volts)) + 1
    levels, readings = [], []
    for rows in np.split(np.arange(len(record)), edges):
        count = max(1, round(_SETTLED_SHARE * len(rows)))
        values = record.displacement_um[rows[-count:]]
        if np.isfinite(values).any():
            levels.append(volts[rows[0]])
            readings.append(float(np.nanmean(values)))
    return np.array(levels), np.array(readings)


def _line(voltage_V: Array, displacement_um: Array) -> Line:
    slope, offset = np.polyfit(voltage_V, displacement_um, 1)
    left = displacement_um - slope * voltage_V - offset
    total = displacement_um - displacement_um.mean()
    return Line(float(slope), 1.0 - float(left @ left) / float(total @ total), len(voltage_V))
