"""What the optional channels of a record testify: the supply's read-back voltage, and the temperature.

The read-back stands between what lies before the terminals (steps of the supply, its slew limit, its slow fall) and
what lies after them. Where it follows the command, an effect before it can only be as large as the read-back leaves
room for; where the temperature stays, nothing drifts with it. A channel only ever contradicts: that it agrees with an
effect is no proof of it.

When a read-back was taken is known to a row: between the row's reading and the next one's. So only rows whose command
has been held for a whole row are held against it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bender_discrepancy.effects.form import Form, Free
from bender_loop.records.record import Record
from bender_report.wording import quantity

Array = NDArray[np.float64]

FEWEST_ROWS = 30
FEWEST_LEVELS = 12
"""Commands at fewer levels may all lie on the steps of the supply by chance."""
NOISES = 5.0
LEAST_TOLERANCE_V = 0.005
LONG_HELD = 5
"""Rows: what a supply does after a change is over by then, or the read-back does not follow."""
ROOM = 1.5
"""Between what a read-back shows and what it excludes."""
MOST_OFF = 0.1
"""A read-back whose gain or noise is off by more than this part of the range is none."""
WARM_K = 0.05
"""A temperature that stays within this does not move a film by what a camera sees."""
INF = math.inf


@dataclass(frozen=True, slots=True)
class WitnessBounds:
    """Bounds that the channels of all records leave.

    Attributes:
        slew_V_per_s: the supply's slew rate is at least this.
        fall_s: the time constant of its fall is at most this.
        step_V: its steps are at most this.
        is_isothermal: the temperature stayed where it was, in every record.
        sentences: what was testified, for the report.
    """

    slew_V_per_s: float = 0.0
    fall_s: float = INF
    step_V: float = INF
    is_isothermal: bool = False
    sentences: tuple[str, ...] = ()

    def of_form(self, form: Form) -> Form | None:
        """Return a form with the numbers that the channels leave it; None where they contradict all of them."""
        match form.effect:
            case "slew_limit":
                return _bounded(form, "slew_rate_V_per_s", low=self.slew_V_per_s)
            case "supply_fall_lag":
                return _bounded(form, "time_constant_s", high=self.fall_s)
            case "supply_quantisation":
                return _bounded(form, "step_V", high=self.step_V)
            case "thermal_drift":
                return None if self.is_isothermal else form
            case _:
                return form


def witness_bounds(records: Sequence[Record]) -> WitnessBounds:
    """Return what the channels of the records of one bench testify together."""
    found = [x for record in records if (x := _of_supply(record)) is not None]
    warm = [_stays_warm(record) for record in records]
    isothermal = bool(warm) and all(warm)
    slew, fall, step = (
        max((x.slew_V_per_s for x in found), default=0.0),
        min((x.fall_s for x in found), default=INF),
        min((x.step_V for x in found), default=INF),
    )
    said = []
    limits = [
        *([f"a slew limit below {quantity(slew, 'V/s', 2)}"] if slew > 0.0 else []),
        *([f"a fall slower than {quantity(fall, 's', 2)}"] if fall < INF else []),
        *([f"steps above {quantity(step, 'V', 2)}"] if step < INF else []),
    ]
    if limits:
        said.append(f"witness: the supply's read-back voltage follows the command, which excludes {', '.join(limits)}")
    if isothermal:
        said.append(f"witness: the temperature stays within {WARM_K:g} K, which excludes thermal_drift")
    return WitnessBounds(slew, fall, step, isothermal, tuple(said))


def _bounded(form: Form, name: str, low: float = 0.0, high: float = INF) -> Form | None:
    free = tuple(_within(x, low, high) if x.name == name else x for x in form.free)
    return None if any(x.low >= x.high for x in free) else replace(form, free=free)


def _within(free: Free, low: float, high: float) -> Free:
    least, most = max(free.low, low), min(free.high, high)
    starts = tuple(x for x in free.starts if least <= x <= most)
    if free.starts and not starts and least < most:
        starts = (math.sqrt(least * most),)
    return replace(free, low=least, high=most, starts=starts)


def _of_supply(record: Record) -> WitnessBounds | None:
    """Return what one record's read-back leaves; None where there is none to be relied on."""
    if record.supply_voltage_V is None:
        return None
    command, read = record.voltage_V, record.supply_voltage_V
    held = _rows_held(command)
    rested = np.isfinite(read) & (held >= LONG_HELD)
    if np.count_nonzero(rested) < FEWEST_ROWS:
        return None
    # at rest the meter shows what it makes of a voltage
    slope, offset = np.polyfit(command[rested], read[rested], 1) if np.ptp(command[rested]) > 0.0 else (1.0, 0.0)
    span = float(np.ptp(command))
    if not abs(slope - 1.0) < MOST_OFF or span == 0.0:
        return None
    off = np.abs((read - offset) / slope - command)
    tolerance = max(LEAST_TOLERANCE_V, NOISES * 1.4826 * float(np.median(off[rested])))
    if tolerance > MOST_OFF * span:
        return None
    return WitnessBounds(
        _fastest_V_per_s(record, off, held, tolerance),
        _slowest_fall_s(record, off, held, tolerance),
        _largest_step_V(command, off, rested, tolerance),
    )


def _rows_held(command: Array) -> NDArray[np.intp]:
    """Return for how many rows each command has been the same before its own row."""
    changed = np.flatnonzero(np.concatenate([[True], np.diff(command) != 0.0]))
    begun = changed[np.searchsorted(changed, np.arange(command.size), side="right") - 1]
    return np.arange(command.size) - begun


def _changes(record: Record, off: Array, held: NDArray[np.intp], tolerance: float) -> tuple[NDArray[np.intp], Array]:
    """Return the first rows that have held a changed command for a whole row, and the change in V.

    Only changes from a level that was reached: else it is not known how far the supply had to go.
    """
    rows = np.flatnonzero((held == 1) & np.isfinite(off) & (np.arange(off.size) >= 2))
    begun = rows - 2
    rows = rows[(held[begun] >= 1) & (off[begun] <= tolerance)]
    return rows, record.voltage_V[rows] - record.voltage_V[rows - 2]


def _fastest_V_per_s(record: Record, off: Array, held: NDArray[np.intp], tolerance: float) -> float:
    rows, change = _changes(record, off, held, tolerance)
    done = (off[rows] <= tolerance) & (np.abs(change) > 2.0 * tolerance)
    if not done.any():
        return 0.0
    period_s = float(np.median(np.diff(record.time_s)))
    # the read-back came at the end of its row at the latest: two rows after the command
    return float(np.max(np.abs(change[done]))) / (2.0 * period_s * ROOM)


def _slowest_fall_s(record: Record, off: Array, held: NDArray[np.intp], tolerance: float) -> float:
    rows, change = _changes(record, off, held, tolerance)
    falls = change < -20.0 * tolerance
    if np.count_nonzero(falls) < 3:
        return INF
    period_s = float(np.median(np.diff(record.time_s)))
    left = np.maximum(off[rows[falls]], tolerance)
    ratio = np.log(np.maximum(-change[falls] / left, 1.0 + 1e-9))
    # the read-back came within its row: one to two rows after the command
    return ROOM * float(np.max(2.0 * period_s / ratio))


def _largest_step_V(command: Array, off: Array, rested: NDArray[np.bool_], tolerance: float) -> float:
    levels = np.unique(np.round(command[rested], 6))
    if levels.size < FEWEST_LEVELS:
        return INF
    return ROOM * 2.0 * (float(np.max(off[rested])) + tolerance)


def _stays_warm(record: Record) -> bool:
    found = record.temperature_C
    if found is None:
        return False
    known = found[np.isfinite(found)]
    return known.size >= FEWEST_ROWS and float(np.ptp(known)) <= WARM_K
