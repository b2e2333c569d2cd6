"""Rows that a logger has lost: put in between the others, without a reading, their commands between those around them.

A device answers the commands of missing rows too. Where rows come at even times and the command moves from row to row,
the last command that is there was not held meanwhile: a model that is driven as if it had been is led astray, and the
readings behind the gap look like an effect. The commands that are there tell whether a cubic or a straight line
foretells them better from their neighbours, and how well it does so across as many rows. Where it does not, nobody
knows what the device went through, nor when a held command changed: readings behind the gap are left out.

A logger that takes rows when something happens lacks none: its pauses end where the command changes.
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
ON_PURPOSE_PART = 0.5
"""Of the changes of a command, how many end a pause by no chance."""
MOST_AT_ONCE = 32
"""Missing rows in a row; which way a command took in a longer pause nobody can guess."""
FORETOLD, WINDOWS = 0.1, 100
"""Of the spread of the command, what those put in may be off; and rows that are there for which that is tried."""
LEAST_BLIND, BLIND_PART, MOST_BLIND = 8, 0.1, 200
"""Rows, part of the rows, and rows: behind a pause of unknown commands as many readings are left out as are missing,
within these."""
MOST_BLIND_PART = 0.25
"""Of all readings: where more would be left out, none are."""
BETTER, MOST_SMOOTH = 0.5, 8
"""Of the error of a straight line, what a cubic leaves where it is taken; and missing rows in a row that it bridges."""
AROUND = 6
"""Rows on either side of a gap that a cubic across it goes through, at most."""
MOST_PART = 0.5
"""Of the rows that are there."""


def completed(record: Record) -> Record:
    """Return a record with the rows that are missing put in; the same one where none are, or none can be."""
    if record.made_up is not None or record.pauses:
        return record
    missing = _missing(record)
    if not missing.any():
        return record
    commands = _Commands(record.voltage_V, missing)
    record = _without_what_follows(record, commands)
    missing = np.where((missing <= MOST_AT_ONCE) & _moves(record.voltage_V), missing, 0)
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
    columns |= {"time_s": time_s, "voltage_V": commands.put_in(missing, places)}
    if record.command_time_s is not None:
        acting_s = time_s + between(record.command_time_s - record.time_s)
        # a command that came late in a gap acts before the row that is put in behind it
        columns["command_time_s"] = np.minimum(acting_s, np.append(time_s[1:], np.inf))
    if record.exposure_s is not None:
        columns["exposure_s"] = np.full(rows.size, record.exposure)
    further = tuple(replace(x, values=between(x.values)) for x in record.further)
    pauses = tuple(int(places[k]) for k in record.pauses)
    return replace(record, **columns, further=further, made_up=made_up, pauses=pauses)


def without_remembered(record: Record, memory_s: float) -> Record:
    """Return a record without the readings in which a device may still answer what it was told in a pause.

    Args:
        record: as `completed` returns it.
        memory_s: how long the device answers a command; behind each pause at most a tenth of the record is left out,
            and behind all of them a quarter.
    """
    readings, duration_s = record.displacement_um.copy(), float(np.ptp(record.time_s))
    parts = (BLIND_PART, MOST_BLIND_PART / max(len(record.pauses), 1))
    for k in record.pauses:
        begin_s = float(record.time_s[k])
        readings[k : np.searchsorted(record.time_s, begin_s + min(memory_s, min(parts) * duration_s))] = np.nan
    return _blinded(record, readings)


def _moves(voltage_V: Array) -> bool:
    return bool(np.count_nonzero(np.diff(voltage_V)) >= MOVING_PART * voltage_V.size)


def _missing(record: Record) -> NDArray[np.int64]:
    """Return how many rows are missing behind each but the last one (n - 1,); none where the clock is not even.

    None are missing either where pauses end by no chance with another command.
    """
    steps = np.diff(record.time_s)
    steps = steps / np.median(steps)
    near = np.maximum(np.round(steps), 1.0)
    apart = np.abs(steps - near)
    if np.mean(near == 1.0) < EVEN_PART or np.mean(apart <= EVEN) < EVEN_PART:
        return np.zeros(steps.size, dtype=np.int64)
    # over many rows an uneven clock adds up
    found = np.where(apart <= EVEN * np.sqrt(np.maximum(near - 1.0, 1.0)), near - 1.0, 0.0).astype(np.int64)
    changes = np.diff(record.voltage_V) != 0.0
    is_on_purpose = np.count_nonzero(changes & (near > 1.0)) > ON_PURPOSE_PART * np.count_nonzero(changes)
    return np.zeros_like(found) if is_on_purpose and np.count_nonzero(changes) > 1 else found


class _Commands:
    """The commands that are there, and how well they foretell those between them."""

    def __init__(self, voltage_V: Array, missing: NDArray[np.int64]) -> None:
        self.volts, self.missing = voltage_V, missing
        self._spread = float(np.std(voltage_V))
        self._gaps_before = np.concatenate([[0], np.cumsum(missing > 0)])
        before, after = voltage_V[1:-3], voltage_V[3:-1]
        middle, far = voltage_V[2:-2], voltage_V[:-4] + voltage_V[4:]
        whole = (missing[:-3] + missing[1:-2] + missing[2:-1] + missing[3:]) == 0
        straight, cubic = (
            float(np.sum((middle - x)[whole] ** 2))
            for x in (0.5 * (before + after), (4.0 * (before + after) - far) / 6.0)
        )
        self._is_smooth = cubic < BETTER**2 * straight
        self._foretold: dict[tuple[int, bool], bool] = {}

    def put_in(self, missing: NDArray[np.int64], places: NDArray[np.int64]) -> Array:
        """Return the commands of all rows: those that are there, and between them a smooth course or a straight one."""
        rows = np.arange(places[-1] + 1)
        found = np.interp(rows, places, self.volts)
        if self._is_smooth:
            bridged = np.repeat(missing, missing + 1)[: rows.size - 1] <= MOST_SMOOTH
            bridged = np.append(bridged, False)
            bridged[places] = False
            found[bridged] = CubicSpline(places, self.volts)(rows[bridged])
        return found

    def are_foretold(self, row: int) -> bool:
        """Return whether what would be put in behind a row meets commands that are there, elsewhere, across as many.

        A gap whose ends are alike is judged by such places, and one whose ends differ by others.
        """
        missing, differs = int(self.missing[row]), self._differs(row, row + 1)
        if missing > MOST_AT_ONCE:
            return False
        key = missing, differs
        if key not in self._foretold:
            self._foretold[key] = self._is_foretold(missing, differs)
        return self._foretold[key]

    def _differs(self, one: int, other: int) -> bool:
        return bool(abs(self.volts[other] - self.volts[one]) > FORETOLD * self._spread)

    def _is_foretold(self, missing: int, differs: bool) -> bool:
        width = missing + 1
        begins = np.arange(self.volts.size - width)
        begins = begins[self._gaps_before[begins] == self._gaps_before[begins + width]]
        moved = np.abs(self.volts[begins + width] - self.volts[begins])
        begins = begins[(moved > FORETOLD * self._spread) == differs]
        begins = begins[:: 1 + begins.size // WINDOWS]
        if begins.size == 0:
            return False
        off = [self._off(int(k), missing) for k in begins]
        return float(np.mean(off)) <= (FORETOLD * self._spread) ** 2

    def _off(self, begin: int, missing: int) -> float:
        """Return the mean square by which commands are missed that are put in the place of some that are there."""
        inside = np.arange(begin + 1, begin + 1 + missing)
        if self._is_smooth and missing <= MOST_SMOOTH:
            low, high = max(begin - AROUND + 1, 0), min(begin + missing + 1 + AROUND, self.volts.size)
            around = np.concatenate([np.arange(low, begin + 1), np.arange(begin + missing + 1, high)])
            put_in = CubicSpline(around, self.volts[around])(inside)
        else:
            put_in = np.interp(inside, [begin, begin + missing + 1], self.volts[[begin, begin + missing + 1]])
        return float(np.mean((put_in - self.volts[inside]) ** 2))


def _without_what_follows(record: Record, commands: _Commands) -> Record:
    """Return a record without the readings behind pauses in which the command went a way that nobody can guess."""
    readings, missing = record.displacement_um.copy(), commands.missing
    most = min(MOST_BLIND, int(BLIND_PART * len(record)))
    moved = (missing > 0) & (np.diff(record.voltage_V) != 0.0)
    pauses = [k + 1 for k in np.flatnonzero(moved).tolist() if not commands.are_foretold(k)]
    for k in pauses:
        readings[k : k + min(most, max(LEAST_BLIND, int(missing[k - 1])))] = np.nan
    if not pauses or _is_too_much(record, readings):
        return record
    return _blinded(replace(record, pauses=tuple(pauses)), readings)


def _is_too_much(record: Record, readings: Array) -> bool:
    kept, there = (int(np.count_nonzero(np.isfinite(x))) for x in (readings, record.displacement_um))
    return record.behind_pauses + there - kept > MOST_BLIND_PART * (record.behind_pauses + there)


def _blinded(record: Record, readings: Array) -> Record:
    count = int(np.count_nonzero(np.isfinite(record.displacement_um) & np.isnan(readings)))
    if count == 0:
        return record
    return replace(record, displacement_um=readings, behind_pauses=record.behind_pauses + count)
