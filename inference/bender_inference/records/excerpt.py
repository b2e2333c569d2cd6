"""Long records: effects are sought in rows from all over each, whose plant remembers what was commanded in between.

The commands are simulated one and all as far as that takes no longer than a record of usual length; of a still longer
record, one window is, and what was commanded before it is told by its extremes and means.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bender_compiled.simulation import Drive
from bender_inference.records.observations import Array, Observations, Part
from bender_inference.records.roles import folds_of, held_out_and_reported
from bender_loop.records.initial_motion import starts_at_rest
from bender_loop.records.telling_rows import Rows, changing_commands, first_row, telling_rows, telling_window

# of all records together: more rows than these are searched in part. So many changes of the command, and so long a
# time, are then simulated, in which a mode of 104 Hz can be simulated in full, so that every effect can be tried; so
# many rows of that time are read
MOST_ROWS = 12_000
EXCERPT_CHANGES = 20_000
EXCERPT_ROWS = 10_000
EXCERPT_S = 1_500.0
FEWEST_ROWS = 2_000
# a row after which a smooth course is followed costs as many sub-steps of a search as so many held ones
SMOOTH_ROW = 3
# a row of an untimed record is held until whatever relaxes has relaxed, and costs as much as hundreds of others
MOST_UNTIMED_ROWS = 500
# of one excerpt, however many records there are
FEWEST_OF_ONE = 100
# commands before an excerpt that are kept as they were; older ones are told by their extremes and their mean
EXACT_COMMANDS = 2_000
BLOCKS_PER_AGE = 8


@dataclass(frozen=True, slots=True, eq=False)
class Excerpt:
    """Which rows (k,) of a record were searched, in their order; `whole` is the record.

    The first `after_a_guess` rows tell what was commanded before the record, which is a guess. They count nowhere.
    """

    whole: Observations
    rows: Rows
    after_a_guess: int = 0

    @property
    def is_all(self) -> bool:
        """Whether every row of the record was searched."""
        return self.rows.size == self.whole.measured_um.size

    def seen(self) -> Observations:
        """Return the observations of the excerpt, by the clock of the record."""
        if self.is_all:
            return self.whole
        x = self.whole
        drive, commands = _drive_of(x, self.rows)
        course_V = x.command_V[self.rows[0] : self.rows[-1] + 1]
        held_out, reported = held_out_and_reported(x.usable[self.rows], x.command_V[self.rows])
        return replace(
            x,
            drive=drive,
            measured_um=x.measured_um[self.rows],
            usable=x.usable[self.rows],
            held_out=held_out,
            reported=reported,
            lacking_um=None if x.lacking_um is None else x.lacking_um[self.rows],
            part=Part(self.rows, commands, course_V),
            first_folds=folds_of(x.usable[self.rows]),
        )

    def judged(self, seen: Observations) -> Observations:
        """Return the whole record as what was done with its excerpt leaves it: every other row is held out."""
        if self.is_all:
            return seen
        usable, held_out = self.whole.usable.copy(), np.ones(self.whole.usable.size, dtype=np.bool_)
        reported = held_out.copy()
        usable[: self.after_a_guess] = False
        usable[self.rows], held_out[self.rows] = seen.usable, seen.held_out
        reported[self.rows] = seen.reported
        return replace(self.whole, usable=usable, held_out=held_out, reported=reported)


def excerpts(observations: Sequence[Observations], untimed: bool = False) -> tuple[Excerpt, ...]:
    """Return what of every record is searched: all of it, unless the records are long."""
    if sum(_cost(x) * x.measured_um.size for x in observations) <= (MOST_UNTIMED_ROWS if untimed else MOST_ROWS):
        return tuple(Excerpt(x, np.arange(x.measured_um.size)) for x in observations)
    return tuple((_untimed_excerpt if untimed else _excerpt)(x, len(observations)) for x in observations)


def _cost(x: Observations) -> int:
    return SMOOTH_ROW if x.drive.smooth else 1


def _untimed_excerpt(x: Observations, records: int) -> Excerpt:
    rows = min(max(MOST_UNTIMED_ROWS // records, FEWEST_OF_ONE), x.measured_um.size)
    known = _known(x, rows)
    return Excerpt(x, known + first_row(x.command_V[known:], x.usable[known:], rows) + np.arange(rows), known)


def _excerpt(x: Observations, records: int) -> Excerpt:
    if x.drive.smooth:
        return _smooth_excerpt(x, records)
    longest = max(int(EXCERPT_S / float(np.median(np.diff(x.time_s)))), FEWEST_ROWS)
    known = _known(x, min(longest, x.measured_um.size))
    volts, read = x.command_V[known:], x.usable[known:]
    window = telling_window(volts, read, longest, max(EXCERPT_CHANGES // (records * _cost(x)), FEWEST_OF_ONE))
    most = max(EXCERPT_ROWS // records, FEWEST_OF_ONE)
    return Excerpt(x, known + window.start + telling_rows(volts[window], read[window], most), known)


def _smooth_excerpt(x: Observations, records: int) -> Excerpt:
    """Return consecutive rows: a course that never stands has no quick part and no slow one to be shown apart."""
    rows = min(max(EXCERPT_ROWS // (records * SMOOTH_ROW), FEWEST_ROWS // records, FEWEST_OF_ONE), x.measured_um.size)
    known = _known(x, rows)
    return Excerpt(x, known + first_row(x.command_V[known:], x.usable[known:], rows) + np.arange(rows), known)


def _known(x: Observations, rows: int) -> int:
    """Return how many rows go before a window of so many: what was commanded before a record in motion is a guess."""
    return 0 if starts_at_rest(x.command_V) else min(EXACT_COMMANDS, x.measured_um.size - rows)


def _drive_of(x: Observations, rows: Rows) -> tuple[Drive, Rows]:
    """Return the drive of some rows (k,), and which of its commands is that of each row, counted from the last one."""
    leads = x.drive.voltage_V.size - x.measured_um.size
    begin, end = leads + int(rows[0]), leads + int(rows[-1]) + 1
    within = begin + _changing(x.drive, slice(begin, end))
    kept = np.concatenate([_kept_commands(x.drive.voltage_V[:begin]), within])
    volts = x.drive.voltage_V.copy()
    for block in _blocks(begin):
        volts[block] = _without_detail(volts[block])
    drive = replace(
        x.drive,
        row_time_s=x.drive.row_time_s[rows],
        command_time_s=x.drive.command_time_s[kept],
        voltage_V=volts[kept],
    )
    return drive, np.searchsorted(kept, leads + rows, side="right") - 1 - kept.size


def _changing(drive: Drive, commands: slice) -> Rows:
    """Return which of some commands tell all of them."""
    volts = drive.voltage_V[commands]
    return np.arange(volts.size) if drive.smooth else changing_commands(volts, drive.linear)


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


def _kept_commands(volts: Array) -> Rows:
    """Return which commands tell those before an excerpt, whose details are gone: where something changes."""
    found = list(range(max(volts.size - EXACT_COMMANDS, 0), volts.size))
    for block in _blocks(volts.size):
        around = [block.start + k + step for k in _extremes(volts[block]) for step in (-1, 0, 1)]
        found += [block.start, *around, block.stop - 1]
    return np.unique(np.clip(np.array(found, dtype=np.intp), 0, max(volts.size - 1, 0)))
