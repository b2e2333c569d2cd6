"""What the input does between the rows, told by the records: held, straight from row to row, or band-limited.

A held input acts from its row on, so a reading cannot answer the input of its own row. Where readings do, beside the
rows before, simple structures are fitted with each course and judged on blocks that their fits have not seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from threadpoolctl import threadpool_limits

from bender_identify.first_model.choice import Scored, is_better, structures_scored
from bender_identify.first_model.excerpt import excerpts
from bender_identify.first_model.fit import CANNOT_BE, FitTask, Mask
from bender_identify.first_model.misread import SIMPLE, lacking, memory_of, without_misread
from bender_identify.first_model.structures import Structure
from bender_identify.records.experiment import Experiment, experiment_of, starts_in_motion
from bender_identify.settings import InputHold, Settings
from bender_loop.records.distinct import refuse_twice_the_same
from bender_loop.records.missing_rows import completed, without_remembered
from bender_loop.records.record import Record
from bender_loop.records.repeated_readings import without_repeats
from bender_loop.records.zero_move import without_zero_move

SLOW = Structure(lags=1)
MOST_LEFT = 0.5
"""Of the mean square that a held input leaves, or an open beginning: another one may take off less by standing in for
what is missing."""
EVEN = 1e-3
"""Of a step: a band-limited course is one through even rows."""
EARLIER_ROWS = 8
"""By which a reading is predicted before that of its own row is asked for."""
DEVIATIONS = 4.0
"""Of the slope by the input of the same row: fewer are chance."""


def experiments_of(
    records: Sequence[Record], names: Sequence[str], input_hold: InputHold | Literal["auto"] = "auto"
) -> list[Experiment]:
    """Return records made ready for fits, in the order given.

    Args:
        records: of one device, in the same quantities.
        names: of the records, for messages; "record 1" and so on where there are none.
        input_hold: what the input does between two rows; "auto" where the records are to tell.

    Raises:
        InputError: the input or the reading of a record stands still, it has too few readings, or is there twice.
    """
    names = names or [f"record {k + 1}" for k in range(len(records))]
    refuse_twice_the_same(names, records)
    known = _known(records, names, "hold" if input_hold == "auto" else input_hold)
    return _ready(known, names, _course(known, names) if input_hold == "auto" else input_hold)


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """A record without what nobody knows.

    Attributes:
        record: without it.
        misread: (n,) which of its readings were misread; None where none was sought.
        in_motion: whether it starts in the middle of a motion; None for what it tells by itself.
    """

    record: Record
    misread: Mask | None = None
    in_motion: bool | None = None


def _known(records: Sequence[Record], names: Sequence[str], input_hold: InputHold) -> list[_Known]:
    found = [_Known(completed(without_zero_move(without_repeats(x)))) for x in records]
    if any(x.record.pauses for x in found):
        memory_s = memory_of(_ready(found, names, input_hold))
        found = [_Known(without_remembered(x.record, memory_s)) for x in found]
    found = _begun(found, names, input_hold)
    ready = _ready(found, names, input_hold)
    kept = without_misread(ready)
    lost = [np.isfinite(x.measured_um) & np.isnan(y.measured_um) for x, y in zip(ready, kept, strict=True)]
    return [replace(x, misread=m) for x, m in zip(found, lost, strict=True)]


def _begun(known: list[_Known], names: Sequence[str], course: InputHold) -> list[_Known]:
    """Return the records, those at rest before they began whose first command acts already.

    Such a record may have begun anywhere, and its beginning is set aside. A slow device still leaves then what a wrong
    guess left it with. Rest is a guess that may be refuted: where a gain or a lag from rest leaves clearly less of all
    rows, the first ones included, it was at rest.
    """
    open_ = [
        x.in_motion and not starts_in_motion(y.record) for x, y in zip(_ready(known, names, course), known, strict=True)
    ]
    if not any(open_):
        return known
    at_rest = [replace(x, in_motion=False) if y else x for x, y in zip(known, open_, strict=True)]
    one, other = (_best(x, names, course, SLOW) for x in (at_rest, known))
    if one is None or other is None:
        return known
    return at_rest if one.rms**2 < MOST_LEFT * other.rms**2 else known


def _ready(known: Sequence[_Known], names: Sequence[str], course: InputHold) -> list[Experiment]:
    made = [
        experiment_of(x.record, n, Settings(), course, any_answer=True, in_motion=x.in_motion)
        for x, n in zip(known, names, strict=True)
    ]
    return [y if x.misread is None else lacking(y, x.misread) for x, y in zip(known, made, strict=True)]


@threadpool_limits.wrap(limits=1)
def course_between_rows(records: Sequence[Record], names: Sequence[str] = ()) -> InputHold:
    """Return what the input does between the rows; "hold" unless the records clearly say another course.

    Args:
        records: of one device, in the same quantities.
        names: of the records, for messages.

    Raises:
        InputError: the input or the reading stands still, or there are too few readings.
    """
    if not any(_answers_at_once(x) for x in records):
        return "hold"
    names = names or [f"record {k + 1}" for k in range(len(records))]
    return _course(_known(records, names, "hold"), names)


def _course(known: Sequence[_Known], names: Sequence[str]) -> InputHold:
    if not any(_answers_at_once(x.record) for x in known):
        return "hold"
    found: InputHold = "hold"
    best = _best(known, names, "hold")
    straight = _best(known, names, "linear")
    if _is_better(straight, best, MOST_LEFT):
        found, best = "linear", straight
    smooth = _best(known, names, "smooth") if all(_may_be_band_limited(x.record) for x in known) else None
    return "smooth" if _is_better(smooth, best, MOST_LEFT if found == "hold" else 1.0) else found


def _is_better(one: Scored | None, other: Scored | None, most_left: float) -> bool:
    """Return whether one leaves clearly less than another one, and no more than a part of its mean square."""
    if one is None or other is None or one.left.losses.size != other.left.losses.size:
        return one is not None and other is None
    is_less = one.held_out_rms**2 < most_left * other.held_out_rms**2
    return is_less and is_better(other.left, one.left)


def _best(known: Sequence[_Known], names: Sequence[str], course: InputHold, only: Structure = SIMPLE) -> Scored | None:
    """Return the simple structure that predicts unseen blocks best; None where none can be simulated."""
    experiments = _ready(known, names, course)
    try:
        scores = structures_scored(FitTask.of(excerpts(experiments, stretches=True), rough=True), only=only)
    except CANNOT_BE:
        return None
    return min(scores, key=lambda x: x.held_out_rms)


def _answers_at_once(record: Record) -> bool:
    """Return whether readings answer the input of their own row, beside inputs and readings of the rows before."""
    u, y = record.voltage_V, record.displacement_um
    rows = np.lib.stride_tricks.sliding_window_view
    columns = np.column_stack([rows(u, EARLIER_ROWS + 1), rows(y, EARLIER_ROWS + 1)])
    known = columns[np.all(np.isfinite(columns), axis=1)]
    if known.shape[0] < 2 * known.shape[1]:
        return False
    own, answer = known[:, EARLIER_ROWS], known[:, -1]
    before = np.column_stack([np.delete(known[:, :-1], EARLIER_ROWS, axis=1), np.ones(known.shape[0])])
    own, answer = (x - before @ np.linalg.lstsq(before, x, rcond=None)[0] for x in (own, answer))
    power = float(own @ own) * float(answer @ answer)
    share = float(own @ answer) ** 2 / power if power > 0.0 else 0.0
    freedom = known.shape[0] - known.shape[1]
    return share * freedom > DEVIATIONS**2 * (1.0 - share)


def _may_be_band_limited(record: Record) -> bool:
    """Return whether rows are even and the input changes from row to row: one that stands still is no sum of waves."""
    steps_s = np.diff(record.time_s)
    is_even = np.ptp(steps_s) <= EVEN * np.median(steps_s)
    return bool(is_even) and 2 * int(np.count_nonzero(np.diff(record.voltage_V))) >= len(record)
