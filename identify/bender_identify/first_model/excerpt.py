"""A part of a long record that is enough to choose a structure.

Of a held input, rows that show what is quick and what is slow are read, under as much of the input as can be simulated
again and again. Of one that runs on between its rows, rows are left out only where input and readings hold next to
nothing above what the remaining ones still show, so that a ringing keeps its rows. What is still too long is cut to
stretches from all over the record. Rows before a part bring the plant into its motion and count for nothing.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive
from bender_identify.records.experiment import Experiment
from bender_loop.records.telling_rows import changing_commands, telling_rows, telling_window

Array = NDArray[np.float64]

MOST_ROWS = 2000
MOST_CHANGES = 3
"""Of a held input, for every row that is read."""
STRETCHES = 4
LEAD_IN = 0.15
"""Of a stretch: its rows that bring the plant into its motion."""
ROWS_PER_PERIOD = 8.0
"""Of the quickest content of a record, after rows are left out."""
QUICK_PART = 1e-3
"""Of the power of changes: what is quicker is left out."""
PIECES = 2
"""Straight pieces of the input between two rows of an excerpt."""
EVEN = 0.2
"""Of the usual step: how much longer or shorter steps of even rows may be."""


def excerpts(
    experiments: Sequence[Experiment], most_rows: int = MOST_ROWS, *, stretches: bool = False
) -> list[Experiment]:
    """Return records with at most so many rows in all, short ones as they are.

    Args:
        experiments: the records.
        most_rows: of all of them.
        stretches: the same rows whatever the input does between them, so that courses can be compared.
    """
    total = sum(x.time_s.size for x in experiments)
    if total <= most_rows:
        return list(experiments)
    found: list[Experiment] = []
    for x in experiments:
        rows = max(int(most_rows * x.time_s.size / total), min(x.time_s.size, most_rows // (4 * len(experiments))))
        found += _excerpts_of(x, rows, stretches)
    return found


def _excerpts_of(x: Experiment, most_rows: int, stretches: bool) -> list[Experiment]:
    if not stretches and x.time_s.size > most_rows and x.timed and not (x.drive.linear or x.drive.smooth):
        return [_telling_part(x, most_rows)]
    every = min(_rows_apart(x), -(-x.time_s.size // most_rows))
    if x.time_s.size <= most_rows * every:
        return [_stretch(x, 0, x.time_s.size, every, x.lead_rows == 0)]
    count = min(STRETCHES, max(1, most_rows // 200))
    length = most_rows * every // count
    begins = _begins(x, count, length)
    return [_stretch(x, int(a), int(a) + length, every, a == 0 and x.lead_rows == 0) for a in begins]


def _telling_part(x: Experiment, most_rows: int) -> Experiment:
    """Return rows of a record from all over it, or from all over a window where the input changes too often."""
    window = telling_window(x.acting_V, np.isfinite(x.measured_um), x.time_s.size, MOST_CHANGES * most_rows)
    rows = window.start + telling_rows(x.acting_V[window], np.isfinite(x.measured_um[window]), most_rows)
    whole, lead = x.drive, x.lead_rows
    aside = np.zeros(rows.size, dtype=bool)
    first, last = 0, int(np.searchsorted(whole.command_time_s, x.time_s[rows[-1]], side="right"))
    if window.start:
        # the plant comes into its motion
        first, lead = max(int(np.searchsorted(whole.command_time_s, x.time_s[rows[0]], side="right")) - 1, 0), 0
        aside[: max(2, int(LEAD_IN * rows.size))] = True
    told = first + changing_commands(whole.voltage_V[first:last], linear=False)
    read_s = np.concatenate([whole.row_time_s[:lead], x.time_s[rows]])
    drive = replace(
        whole, row_time_s=read_s, command_time_s=whole.command_time_s[told], voltage_V=whole.voltage_V[told]
    )
    return replace(
        x, time_s=x.time_s[rows], measured_um=x.measured_um[rows], acting_V=x.acting_V[rows], drive=drive,
        rough_drive=drive, lead_rows=lead, fitted=x.fitted[rows] & ~aside, held_out=x.held_out[rows] & ~aside,
    )  # fmt: skip


def _begins(x: Experiment, count: int, length: int) -> list[int]:
    """Return where stretches begin, apart from each other: as many where most moves as where little does."""
    moved = np.nan_to_num(x.measured_um - np.nanmean(x.measured_um)) ** 2
    course = np.cumsum(moved / max(float(moved.mean()), 1e-300) + 0.1)
    middles = np.searchsorted(course, course[-1] * (np.arange(count) + 0.5) / count)
    begins: list[int] = []
    for k, middle in enumerate(middles):
        earliest = begins[-1] + length if begins else 0
        latest = x.time_s.size - (count - k) * length
        begins.append(int(min(max(middle - length // 2, earliest), latest)))
    return begins


def _rows_apart(x: Experiment) -> int:
    """Return how many rows may become one: the quickest content keeps its rows, and uneven rows stay."""
    steps = np.diff(x.time_s)
    if float(np.ptp(steps)) > EVEN * float(np.median(steps)) or not (x.drive.linear or x.drive.smooth):
        return 1
    seen = np.isfinite(x.measured_um)
    y = np.interp(x.time_s, x.time_s[seen], x.measured_um[seen])
    highest = max(_highest_part(np.diff(z)) for z in (y, x.acting_V))
    return max(1, int(1.0 / (ROWS_PER_PERIOD * highest)))


def _highest_part(changes: Array) -> float:
    """Return the frequency, in periods per row, below which all but a small part of the power of changes lies."""
    power = np.abs(np.fft.rfft(changes - changes.mean())) ** 2
    total = float(power.sum())
    if total == 0.0:
        return 0.5 / max(changes.size, 1)
    k = int(np.searchsorted(np.cumsum(power), (1.0 - QUICK_PART) * total))
    return max(k, 1) / changes.size


def _stretch(x: Experiment, begin: int, end: int, every: int, from_rest: bool) -> Experiment:
    """Return rows of a record as a record of its own; one that does not begin with it has a lead-in."""
    rows = slice(begin, end, every)
    time_s = x.time_s[rows]
    whole = x.rough_drive
    commands = np.flatnonzero((whole.command_time_s >= time_s[0]) & (whole.command_time_s <= time_s[-1]))
    first = max(int(commands[0]) - 1, 0) if commands.size else 0
    chosen = np.arange(first, (int(commands[-1]) if commands.size else first) + 1)
    if every > 1:
        per_row = max(1, round((chosen.size - 1) / max(end - begin - 1, 1)))
        chosen = chosen[:: max(1, per_row * every // PIECES)]
    aside = np.zeros(time_s.size, dtype=bool)
    if not from_rest:
        aside[: max(2, int(LEAD_IN * time_s.size))] = True
    drive = Drive(
        time_s, whole.command_time_s[chosen], whole.voltage_V[chosen], whole.linear, whole.smooth, whole.exposure_s
    )  # fmt: skip
    return replace(
        x, time_s=time_s, measured_um=x.measured_um[rows], acting_V=x.acting_V[rows], drive=drive, rough_drive=drive,
        lead_rows=0, fitted=x.fitted[rows] & ~aside, held_out=x.held_out[rows] & ~aside,
    )  # fmt: skip
