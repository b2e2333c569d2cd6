"""Rows that a logger has lost: put in between the others, without a reading, their commands between those around them.

A device answers the commands of missing rows too. Where rows come at even times and the command moves from row to row,
the last command that is there was not held meanwhile: a model that is driven as if it had been is led astray, and the
readings behind the gap look like an effect. The commands that are there tell whether a cubic or a straight line
foretells them better from their neighbours, and how well a straight line does across as many rows. Where it does not,
nobody knows what the device went through, nor when a held command changed: readings behind the gap are left out.
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
FORETOLD, WINDOWS = 0.1, 500
"""Of the spread of the command, what a straight line across so many rows may be off; and where that is tried."""
LEAST_BLIND, BLIND_PART, MOST_BLIND = 8, 0.1, 200
"""Rows, part of the rows, and rows: behind a pause of unknown commands as many readings are left out as are missing,
within these."""
BETTER, MOST_SMOOTH = 0.5, 8
"""Of the error of a straight line, what a cubic leaves where it is taken; and missing rows in a row that it bridges."""
MOST_PART = 0.5
"""Of the rows that are there."""


def completed(record: Record) -> Record:
    """Return a record with the rows that are missing put in; the same one where none are, or none can be."""
    if record.made_up is not None or record.behind_pauses:
        return record
    missing = _missing(record)
    record = _without_what_follows(record, missing)
    moves = np.count_nonzero(np.diff(record.voltage_V)) >= MOVING_PART * len(record)
    missing = np.where((missing <= MOST_AT_ONCE) & moves, missing, 0)
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


def _missing(record: Record) -> NDArray[np.int64]:
    """Return how many rows are missing behind each but the last one (n - 1,); none where the clock is not even."""
    steps = np.diff(record.time_s)
    steps = steps / np.median(steps)
    near = np.maximum(np.round(steps), 1.0)
    apart = np.abs(steps - near)
    if np.mean(near == 1.0) < EVEN_PART or np.mean(apart <= EVEN) < EVEN_PART:
        return np.zeros(steps.size, dtype=np.int64)
    # over many rows an uneven clock adds up
    return np.where(apart <= EVEN * np.sqrt(near), near - 1.0, 0.0).astype(np.int64)


def _without_what_follows(record: Record, missing: NDArray[np.int64]) -> Record:
    """Return a record without the readings behind pauses in which the command went a way that nobody can guess."""
    readings, volts = record.displacement_um.copy(), record.voltage_V
    most = min(MOST_BLIND, int(BLIND_PART * len(record)))
    for k in np.flatnonzero((missing > 0) & (np.diff(volts) != 0.0)).tolist():
        if missing[k] > MOST_AT_ONCE or not _is_foretold(volts, int(missing[k])):
            readings[k + 1 : k + 1 + min(most, max(LEAST_BLIND, int(missing[k])))] = np.nan
    count = int(np.count_nonzero(np.isfinite(record.displacement_um) & np.isnan(readings)))
    return replace(record, displacement_um=readings, behind_pauses=count) if count else record


def _is_foretold(volts: Array, missing: int) -> bool:
    """Return whether a straight line across so many rows, between commands that differ, meets those between them."""
    begins = np.arange(volts.size - missing - 1)
    begins = begins[volts[begins] != volts[begins + missing + 1]]
    begins = begins[:: 1 + begins.size // WINDOWS]
    if begins.size == 0:
        return False
    part = np.arange(1, missing + 1) / (missing + 1.0)
    first, last = volts[begins, None], volts[begins + missing + 1, None]
    between = volts[begins[:, None] + np.arange(1, missing + 1)]
    off = float(np.mean(np.square(first + part * (last - first) - between)))
    return off <= FORETOLD**2 * float(np.var(volts))
