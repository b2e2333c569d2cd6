"""A record made ready for fits: what drove it, which rows count, and which of them are held out."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive
from bender_identify.records.excitation import Excitation, check_answered, check_moved, describe
from bender_identify.records.voltage_path import acting_voltage, drive_of, even_times
from bender_identify.settings import InputHold, Settings
from bender_loop.errors import InputError
from bender_loop.records.record import Record, ZeroMove
from bender_loop.records.sizes import check_sizes
from bender_loop.records.zero_move import without_zero_move

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

UNTIMED_ROW_S = 10.0
"""Rows of an untimed record are put this far apart: long beside any ringing of the plant."""
FEWEST_READINGS = 20
MANY_TURNS = 8
MOTION_PART = 0.1
"""Part of a record without a cycle that is set aside where it starts in motion: its initial state is an estimate."""


@dataclass(frozen=True, slots=True, eq=False)
class Experiment:
    """One record, arrays of shape (n,).

    Attributes:
        name: of the record, for tables and messages.
        time_s: of the readings.
        measured_um: readings, NaN where a frame was lost.
        acting_V: the voltage that was acting when the row was read.
        drive: what simulations are driven with.
        rough_drive: the same for a search, with a smooth voltage followed less closely.
        lead_rows: rows of the drive that come before those of the record.
        fitted: rows that a fit sees.
        held_out: rows that are scored, and excluded from fits.
        in_motion: the record starts in the middle of a motion, and the drive with an estimated lead-in.
        excitation: what the voltage does.
        timed: the times mean something.
        input_hold: what the voltage does between two rows.
        zero_move: of the sensor, taken from the readings; None where there was none.
        misread_s: instants of isolated readings that were set aside, see `first_model.misread`.
        behind_pauses: readings that are left out behind pauses, see `bender_loop.records.missing_rows`.
    """

    name: str
    time_s: Array
    measured_um: Array
    acting_V: Array
    drive: Drive
    rough_drive: Drive
    lead_rows: int
    fitted: Mask
    held_out: Mask
    in_motion: bool
    excitation: Excitation
    timed: bool = True
    input_hold: InputHold = "hold"
    zero_move: ZeroMove | None = None
    misread_s: tuple[float, ...] = ()
    behind_pauses: int = 0

    def fitting_all(self) -> "Experiment":
        """Return the experiment with every row that counts fitted."""
        return replace(self, fitted=self.fitted | self.held_out, held_out=np.zeros_like(self.held_out))

    def holding_out_all(self) -> "Experiment":
        """Return the experiment with every row that counts held out."""
        return replace(self, fitted=np.zeros_like(self.fitted), held_out=self.fitted | self.held_out)


def experiment_of(
    record: Record,
    name: str,
    settings: Settings,
    input_hold: InputHold = "hold",
    untimed: bool = False,
    *,
    any_answer: bool = False,
    in_motion: bool | None = None,
) -> Experiment:
    """Make a record ready; the last part of its rows is held out.

    Args:
        record: rows of commands and readings.
        name: of the record, for messages.
        settings: how much is held out and set aside.
        input_hold: what the voltage does between two rows.
        untimed: the times are an order only.
        any_answer: take readings that no linear model follows, and a beginning that nothing tells as one in motion.
        in_motion: whether it starts in the middle of a motion; None for what the record tells.

    Raises:
        InputError: the record excites nothing, does not answer, has too few readings, or is in other units.
    """
    record = without_zero_move(record)
    readings = int(np.isfinite(record.displacement_um).sum())
    if readings < FEWEST_READINGS:
        raise InputError(
            f"{name}: {readings} readings in {len(record)} rows, expected at least {FEWEST_READINGS}; record for longer"
        )
    time_s = even_times(UNTIMED_ROW_S, len(record)) if untimed else record.time_s
    acting_V = record.voltage_V if untimed else acting_voltage(record, input_hold)
    check_sizes(name, record, untimed)
    check_moved(name, record.voltage_V, record.displacement_um)
    if not any_answer:
        check_answered(name, acting_V, record.displacement_um)
    excitation = describe(time_s, acting_V, record.displacement_um)
    if in_motion is None:
        in_motion = starts_in_motion(record) or (any_answer and _may_start_anywhere(record, excitation))
    in_motion = in_motion and not untimed
    settled_s = time_s if untimed else None
    drive, lead_rows = drive_of(record, input_hold, settled_s, in_motion)
    rough_drive, _ = drive_of(record, input_hold, settled_s, in_motion, rough=True)
    aside_s = _set_aside_s(record, excitation, settings, in_motion)
    counted = np.isfinite(record.displacement_um) & (time_s - time_s[0] >= aside_s)
    rows = np.flatnonzero(counted)
    # the reading before anything moved fixes the zero, whatever is set aside after it
    counted[0] = np.isfinite(record.displacement_um[0]) and (counted[0] or not (in_motion or untimed))
    first_held_out = rows[min(len(rows) - 1, int((1.0 - settings.held_out_share) * len(rows)))] if len(rows) else 0
    if first_held_out < FEWEST_READINGS // 2 or len(rows) < FEWEST_READINGS:
        raise InputError(
            f"{name}: {len(rows)} readings are left after what is set aside at the start, expected at least "
            f"{FEWEST_READINGS}; record for longer or set less aside"
        )
    later = np.arange(len(record)) >= first_held_out
    return Experiment(
        name=name,
        time_s=time_s,
        measured_um=record.displacement_um,
        acting_V=acting_V,
        drive=drive,
        rough_drive=rough_drive,
        lead_rows=lead_rows,
        fitted=counted & ~later,
        held_out=counted & later,
        in_motion=in_motion,
        excitation=excitation,
        timed=not untimed,
        input_hold=input_hold,
        zero_move=record.zero_move,
        behind_pauses=record.behind_pauses,
    )


def starts_in_motion(record: Record) -> bool:
    """Whether the first reading belongs to the first voltage rather than to 0 V, judged by a straight line.

    Where that reading is lost nothing speaks against rest.
    """
    voltage_V, reading_um = record.voltage_V, record.displacement_um
    seen = np.isfinite(reading_um)
    if not seen[0] or not voltage_V[:2].any():
        return False
    slope, offset = np.polyfit(voltage_V[seen], reading_um[seen], 1)
    from_rest, from_motion = reading_um[0] - offset, reading_um[0] - offset - slope * voltage_V[0]
    return bool(abs(from_motion) < 0.5 * abs(from_rest))


def _may_start_anywhere(record: Record, excitation: Excitation) -> bool:
    """Whether the first command acts already and enough comes later: what the start was then matters to no fit."""
    return bool(record.voltage_V[:2].any()) and excitation.turns >= MANY_TURNS


def _set_aside_s(record: Record, excitation: Excitation, settings: Settings, in_motion: bool) -> float:
    if settings.set_aside_s is not None:
        return settings.set_aside_s
    if excitation.period_s is not None:
        return excitation.period_s if record.voltage_V[0] != 0.0 else 0.0
    return MOTION_PART * float(record.time_s[-1] - record.time_s[0]) if in_motion else 0.0
