"""Long records: effects are sought in an excerpt of each, whose plant remembers what was commanded before it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from bender_compiled.simulation import Drive
from bender_discrepancy.records.observations import Array, Mask, Observations
from bender_discrepancy.records.roles import held_out_and_reported
from bender_loop.records.initial_motion import starts_at_rest

# of all records together: more than these are searched in excerpts, which hold at most so many rows and last at most so
# long, but for slow rows: a mode of 104 Hz can then be simulated in full, so that every effect can be tried
MOST_ROWS = 20_000
EXCERPT_ROWS = 10_000
EXCERPT_S = 270.0
FEWEST_ROWS = 2_000
# a row after which a smooth course is followed costs as many sub-steps of a search as so many held ones
SMOOTH_ROW = 3
# a row of an untimed record is held until whatever relaxes has relaxed, and costs as much as hundreds of others
MOST_UNTIMED_ROWS = 500
# of one excerpt, however many records there are
FEWEST_OF_ONE = 100
AS_GOOD = 0.9
# commands before an excerpt that are kept as they were; older ones are told by their extremes and their mean
EXACT_COMMANDS = 2_000
BLOCKS_PER_AGE = 8


@dataclass(frozen=True, slots=True, eq=False)
class Excerpt:
    """Which rows of a record were searched: `rows` of them from row `first` on; `whole` is the record.

    The first `after_a_guess` rows tell what was commanded before the record, which is a guess. They count nowhere.
    """

    whole: Observations
    first: int
    rows: int
    after_a_guess: int = 0

    @property
    def window(self) -> slice:
        """The rows that were searched."""
        return slice(self.first, self.first + self.rows)

    @property
    def is_all(self) -> bool:
        """Whether every row of the record was searched."""
        return self.rows == self.whole.measured_um.size

    def seen(self) -> Observations:
        """Return the observations of the excerpt, by the clock of the record."""
        if self.is_all:
            return self.whole
        x = self.whole
        roles = held_out_and_reported(x.usable[self.window], x.command_V[self.window])
        return replace(
            x,
            drive=_drive_of(x, self.window),
            measured_um=x.measured_um[self.window],
            usable=x.usable[self.window],
            held_out=roles[0],
            reported=roles[1],
            lacking_um=None if x.lacking_um is None else x.lacking_um[self.window],
        )

    def judged(self, seen: Observations) -> Observations:
        """Return the whole record as what was done with its excerpt leaves it: every other row is held out."""
        if self.is_all:
            return seen
        usable, held_out = self.whole.usable.copy(), np.ones(self.whole.usable.size, dtype=np.bool_)
        reported = held_out.copy()
        usable[: self.after_a_guess] = False
        usable[self.window], held_out[self.window] = seen.usable, seen.held_out
        reported[self.window] = seen.reported
        return replace(self.whole, usable=usable, held_out=held_out, reported=reported)


def excerpts(observations: Sequence[Observations], untimed: bool = False) -> tuple[Excerpt, ...]:
    """Return what of every record is searched: all of it, unless the records are long."""
    if sum(_cost(x) * x.measured_um.size for x in observations) <= (MOST_UNTIMED_ROWS if untimed else MOST_ROWS):
        return tuple(Excerpt(x, 0, x.measured_um.size) for x in observations)
    return tuple(_excerpt(x, MOST_UNTIMED_ROWS if untimed else _timed_rows(x), len(observations)) for x in observations)


def _timed_rows(x: Observations) -> int:
    return max(int(min(EXCERPT_ROWS / _cost(x), EXCERPT_S / float(np.median(np.diff(x.time_s))))), FEWEST_ROWS)


def _cost(x: Observations) -> int:
    return SMOOTH_ROW if x.drive.smooth else 1


def _excerpt(x: Observations, most: int, records: int) -> Excerpt:
    rows = min(max(most // records, FEWEST_OF_ONE), x.measured_um.size)
    # what was commanded before the first row of a record in motion is a guess
    known = 0 if starts_at_rest(x.command_V) else min(EXACT_COMMANDS, x.measured_um.size - rows)
    return Excerpt(x, known + first_row(x.command_V[known:], x.usable[known:], rows), rows, known)


def first_row(command_V: Array, read: Mask, rows: int) -> int:
    """Return the first row of the earliest window of so many rows that shows nearly as much of a record as any other.

    Args:
        command_V: (n,) of every row.
        read: (n,) which rows have a reading.
        rows: of the window.
    """
    if rows >= command_V.size:
        return 0
    shown = shown_parts(command_V, read, rows)
    return int(np.argmax(shown >= AS_GOOD * float(shown.max())))


def shown_parts(command_V: Array, read: Mask, rows: int) -> Array:
    """Return what part of a record's spectrum and amplitudes every window of so many rows shows, shape (n - rows + 1,).

    Of the spectrum: for each octave of times, the mean square change of the command over such a time before a reading
    in the window, as far as it reaches that of the record (a spectrum by Haar's wavelets). Of the amplitudes: the range
    of the window's commands in parts of that of the record.
    """
    span_V = float(np.ptp(command_V))
    if span_V == 0.0:
        return np.ones(command_V.size - rows + 1)
    octaves = [shown for k in range(rows.bit_length()) if (shown := _octave(command_V, read, rows, 2**k)) is not None]
    size, origin = rows, -(rows // 2)
    ranges = maximum_filter1d(command_V, size, origin=origin) - minimum_filter1d(command_V, size, origin=origin)
    spectrum = np.mean(octaves, axis=0) if octaves else 1.0
    return spectrum * ranges[: command_V.size - rows + 1] / span_V


def _octave(command_V: Array, read: Mask, rows: int, lag: int) -> Array | None:
    """Return how far each window reaches the record's mean square change over so many rows; None where that is none."""
    if lag >= command_V.size:
        return None
    changes = np.square(command_V[lag:] - command_V[:-lag]) * read[lag:]
    if not changes.any():
        return None
    cumulated = np.concatenate([np.zeros(lag + 1), np.cumsum(changes)])
    sums = cumulated[rows:] - cumulated[:-rows]
    return np.minimum(sums / rows / float(changes.sum() / command_V.size), 1.0)


def _drive_of(x: Observations, window: slice) -> Drive:
    leads = x.drive.voltage_V.size - x.measured_um.size
    begin, end = leads + window.start, leads + window.stop
    kept = np.concatenate([_kept_commands(x.drive.voltage_V[:begin]), np.arange(begin, end)])
    volts = x.drive.voltage_V.copy()
    for block in _blocks(begin):
        volts[block] = _without_detail(volts[block])
    return replace(
        x.drive,
        row_time_s=x.drive.row_time_s[window],
        command_time_s=x.drive.command_time_s[kept],
        voltage_V=volts[kept],
    )


def _blocks(count: int) -> list[slice]:
    """Return blocks of so many commands before an excerpt but for the last ones: the older, the longer.

    Each is short beside its age, so that a memory which fades tells hardly more of it than its mean.
    """
    found = []
    end = count - EXACT_COMMANDS
    while end > 0:
        begin = max(end - (count - end) // BLOCKS_PER_AGE, 0)
        found.append(slice(begin, end))
        end = begin
    return found[::-1]


def _extremes(volts: Array) -> list[int]:
    return sorted({int(np.argmin(volts)), int(np.argmax(volts))})


def _without_detail(volts: Array) -> Array:
    """Return commands of which the extremes stay where they were, the others at their mean."""
    ends = _extremes(volts)
    rest = np.delete(volts, ends)
    found = np.full_like(volts, float(rest.mean()) if rest.size else 0.0)
    found[ends] = volts[ends]
    return found


def _kept_commands(volts: Array) -> NDArray[np.intp]:
    """Return which commands tell those before an excerpt, whose details are gone: where something changes."""
    found = list(range(max(volts.size - EXACT_COMMANDS, 0), volts.size))
    for block in _blocks(volts.size):
        around = [block.start + k + step for k in _extremes(volts[block]) for step in (-1, 0, 1)]
        found += [block.start, *around, block.stop - 1]
    return np.unique(np.clip(np.array(found, dtype=np.intp), 0, max(volts.size - 1, 0)))
