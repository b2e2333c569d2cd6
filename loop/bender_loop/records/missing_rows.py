"""Rows that a logger has lost: put in between the others, without a reading, their commands straight in between.

A device answers the commands of missing rows too. Where rows come at even times and the command moves from row to row,
the last command that is there was not held meanwhile: a model that is driven as if it had been is led astray, and the
readings behind the gap look like an effect.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record

Array = NDArray[np.float64]

EVEN, EVEN_PART = 0.25, 0.9
"""Of the usual step of time, by how much steps may differ from it or a multiple; of all steps, how many are usual."""
MOVING_PART = 0.5
"""Of all rows, how many bring another command where it is not held."""
MOST_AT_ONCE = 32
"""Missing rows in a row; which way a command took in a longer pause nobody can guess."""
MOST_PART = 0.5
"""Of the rows that are there."""


def completed(record: Record) -> Record:
    """Return a record with the rows that are missing put in; the same one where none are, or none can be."""
    missing = _missing(record)
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
    columns |= {"time_s": time_s, "voltage_V": between(record.voltage_V)}
    if record.command_time_s is not None:
        columns["command_time_s"] = time_s + between(record.command_time_s - record.time_s)
    if record.exposure_s is not None:
        columns["exposure_s"] = np.full(rows.size, record.exposure)
    further = tuple(replace(x, values=between(x.values)) for x in record.further)
    return replace(record, **columns, further=further, made_up=made_up)


def _missing(record: Record) -> NDArray[np.int64]:
    """Return how many rows are missing behind each but the last one (n - 1,)."""
    steps = np.diff(record.time_s)
    steps = steps / np.median(steps)
    found = np.maximum(np.round(steps), 1.0)
    usual = found == 1.0
    is_even = np.mean(usual) >= EVEN_PART and np.mean(np.abs(steps - found) <= EVEN) >= EVEN_PART
    moves = 2 * np.count_nonzero(np.diff(record.voltage_V)) >= 2 * MOVING_PART * len(record)
    if not (is_even and moves) or record.made_up is not None:
        return np.zeros(steps.size, dtype=np.int64)
    gaps = ~usual & (np.abs(steps - found) <= EVEN) & (found - 1.0 <= MOST_AT_ONCE)
    return np.where(gaps, found - 1.0, 0.0).astype(np.int64)
