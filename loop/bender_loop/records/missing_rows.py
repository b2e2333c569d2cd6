"""Rows that a logger has lost: put in between the others, without a reading, their commands between those around them.

A device answers the commands of missing rows too. Where rows come at even times and the command moves from row to row,
the last command that is there was not held meanwhile: a model that is driven as if it had been is led astray, and the
readings behind the gap look like an effect. The commands that are there tell whether a cubic or a straight line
foretells them better from their neighbours.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from bender_loop.records.record import Record

Array = NDArray[np.float64]

EVEN, EVEN_PART = 0.25, 0.9
"""Of the usual step of time, by how much steps may differ from it or a multiple; of all steps, how many are usual."""
MOVING_PART = 0.5
"""Of all rows, how many bring another command where it is not held."""
MOST_AT_ONCE = 32
"""Missing rows in a row; which way a command took in a longer pause nobody can guess."""
BLIND_PART, MOST_BLIND = 0.05, 200
"""Of the rows, and rows: behind such a pause no more readings are left out, and no more than are missing."""
BETTER, MOST_SMOOTH = 0.5, 8
"""Of the error of a straight line, what a cubic leaves where it is taken; and missing rows in a row that it bridges."""
MOST_PART = 0.5
"""Of the rows that are there."""


def completed(record: Record) -> Record:
    """Return a record with the rows that are missing put in; the same one where none are, or none can be."""
    if record.made_up is not None or record.behind_pauses:
        return record
    steps = _steps(record)
    record = _without_what_follows(record, steps)
    missing = _missing(steps)
    total = int(missing.sum())
    if total == 0 or total > MOST_PART * len(record):
        return record
    # where each row that is there comes to lie, and what lies between
    places = np.arange(len(record)) + np.concatenate([[0], np.cumsum(missing)])
    rows = np.arange(places[-1] + 1)
    made_up = np.ones(rows.size, dtype=np.bool_)
    made_up[places] = False

    def between(values: Array) -> Array:
        return np.interp(rows, places, values)

    def unread(values: Array) -> Array:
        found = np.full(rows.size, np.nan)
        found[places] = values
        return found

    time_s = between(record.time_s)
    columns = {name: unread(x) for name, x in record.columns().items()}
    columns |= {"time_s": time_s, "voltage_V": _commands(record.voltage_V, missing, places)}
    if record.command_time_s is not None:
        acting_s = time_s + between(record.command_time_s - record.time_s)
        # a command that came late in a gap acts before the row that is put in behind it
        columns["command_time_s"] = np.minimum(acting_s, np.append(time_s[1:], np.inf))
    if record.exposure_s is not None:
        columns["exposure_s"] = np.full(rows.size, record.exposure)
    further = tuple(replace(x, values=between(x.values)) for x in record.further)
    return replace(record, **columns, further=further, made_up=made_up)


def _commands(voltage_V: Array, missing: NDArray[np.int64], places: NDArray[np.int64]) -> Array:
    """Return the commands of all rows: those that are there, and between them a smooth course or a straight one."""
    rows = np.arange(places[-1] + 1)
    found = np.interp(rows, places, voltage_V)
    before, after = voltage_V[1:-3], voltage_V[3:-1]
    middle, far = voltage_V[2:-2], voltage_V[:-4] + voltage_V[4:]
    whole = (missing[:-3] + missing[1:-2] + missing[2:-1] + missing[3:]) == 0
    straight, cubic = (
        float(np.sum((middle - x)[whole] ** 2)) for x in (0.5 * (before + after), (4.0 * (before + after) - far) / 6.0)
    )
    if cubic < BETTER**2 * straight:
        bridged = np.repeat(missing, missing + 1)[: rows.size - 1] <= MOST_SMOOTH
        bridged = np.append(bridged, False)
        bridged[places] = False
        found[bridged] = CubicSpline(places, voltage_V)(rows[bridged])
    return found


def _steps(record: Record) -> Array:
    """Return the time from row to row in rows (n - 1,); of a clock that is not even, or a command that is held, 1."""
    steps = np.diff(record.time_s)
    steps = steps / np.median(steps)
    near = np.maximum(np.round(steps), 1.0)
    is_even = np.mean(near == 1.0) >= EVEN_PART and np.mean(np.abs(steps - near) <= EVEN) >= EVEN_PART
    moves = 2 * np.count_nonzero(np.diff(record.voltage_V)) >= 2 * MOVING_PART * len(record)
    return steps if is_even and moves else np.ones(steps.size)


def _missing(steps: Array) -> NDArray[np.int64]:
    """Return how many rows are missing behind each but the last one (n - 1,)."""
    found = np.round(steps)
    gaps = (found > 1.0) & (np.abs(steps - found) <= EVEN) & (found - 1.0 <= MOST_AT_ONCE)
    return np.where(gaps, found - 1.0, 0.0).astype(np.int64)


def _without_what_follows(record: Record, steps: Array) -> Record:
    """Return a record without the readings behind long pauses in which the command has moved."""
    readings, most = record.displacement_um.copy(), min(MOST_BLIND, int(BLIND_PART * len(record)))
    for k in np.flatnonzero((steps - 1.0 > MOST_AT_ONCE) & (np.diff(record.voltage_V) != 0.0)).tolist():
        readings[k + 1 : k + 1 + min(most, round(steps[k]) - 1)] = np.nan
    count = int(np.count_nonzero(np.isfinite(record.displacement_um) & np.isnan(readings)))
    return replace(record, displacement_um=readings, behind_pauses=count) if count else record
