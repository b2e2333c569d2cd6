"""What is to be explained: measured readings, and what each of them is for.

A reading is fitted, chosen on, or reported on. Fits see the first kind. Choices between hypotheses see the first and
the second. The third kind is touched once, when what was chosen is measured: no figure on it is flattered by a choice.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive
from bender_inference.records.excitation import one_sine
from bender_inference.records.roles import folds_of, held_out_and_reported
from bender_loop.records.acting_voltage import acting_V
from bender_loop.records.record import Record
from bender_loop.records.telling_rows import Rows

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
# "rest": nothing was commanded before the first row; "motion": a lead-in was; "from_voltage": one voltage was until
# then; the others: an end of the range was, then the voltage of the first row
Start = Literal["rest", "motion", "from_voltage", "from_above", "from_below"]


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Which rows of a longer record observations are of.

    Attributes:
        rows: (n,) their numbers in the record.
        commands: (n,) which of the drive's commands is that of each, counted from the last one (-1).
        course_V: (m,) the command of every row of the record from the first of them to the last.
    """

    rows: NDArray[np.intp]
    commands: NDArray[np.intp]
    course_V: Array


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """One record ready for fits.

    Attributes:
        drive: what the plant was driven with.
        measured_um: (n,) readings, NaN where lost.
        usable: (n,) readings that count: neither lost nor outlying.
        held_out: (n,) rows that are excluded from fits.
        reported: (n,) rows among them that no choice sees either.
        half_step_um: half the step of coarse readings: each says only that the tip lay within this of it.
        start: how the record is taken to begin, see `initial_motion`.
        lacking_um: (n,) what was taken from the readings before, by which a black box differs from its stand-in; None
            for nothing.
        same_zero: the sensor was not zeroed between the records: one offset holds for all of them.
        part: of a longer record; None where the rows follow each other and the drive ends with their commands.
        first_folds: (n,) folds by which the rows were shared out; None for those of the readings that count now.
    """

    drive: Drive
    measured_um: Array
    usable: Mask
    held_out: Mask
    reported: Mask
    half_step_um: float = 0.0
    start: Start = "rest"
    lacking_um: Array | None = None
    same_zero: bool = False
    part: Part | None = None
    first_folds: NDArray[np.int64] | None = None

    @property
    def folds(self) -> NDArray[np.int64]:
        """(n,) which of twenty folds every row is in, wherever readings have been set aside since."""
        return folds_of(self.usable) if self.first_folds is None else self.first_folds

    @property
    def read_um(self) -> Array:
        """(n,) the readings as the sensor gave them: the steps of a coarse one are those of these."""
        return self.measured_um if self.lacking_um is None else self.measured_um + self.lacking_um

    def rounded_um(self, simulated_um: Array, step_um: float) -> Array:
        """Return simulated readings (n,) as a sensor with so coarse steps gives them."""
        lacking = 0.0 if self.lacking_um is None else self.lacking_um
        return step_um * np.round((simulated_um + lacking) / step_um) - lacking

    def fitted_on(self, rows: Rows) -> "Observations":
        """Return the observations with some rows that are not reported on, because a fit used them."""
        reported = self.reported.copy()
        reported[rows] = False
        return replace(self, reported=reported)

    def beyond(self, residual: Array) -> Array:
        """Return how far the residual lies outside of what a coarse reading allows."""
        if self.half_step_um == 0.0:
            return residual
        return np.sign(residual) * np.maximum(np.abs(residual) - self.half_step_um, 0.0)

    @property
    def time_s(self) -> Array:
        """Instants of the readings."""
        return self.drive.row_time_s

    @property
    def command_V(self) -> Array:
        """Command of every row; what a lead-in commanded before the first one is left out."""
        if self.part is not None:
            return self.drive.voltage_V[self.part.commands]
        return self.drive.voltage_V[-self.measured_um.size :]

    @property
    def course_V(self) -> Array:
        """Command of every row of the record from the first of these to the last, those that are left out included."""
        return self.command_V if self.part is None else self.part.course_V

    @property
    def places(self) -> NDArray[np.intp]:
        """(n,) where the rows stand among those of `course_V`."""
        return np.arange(self.measured_um.size) if self.part is None else self.part.rows - self.part.rows[0]

    @property
    def rest_before_V(self) -> float | None:
        """The voltage at which the plant stood before the record, None where it did not or nothing was commanded."""
        return None if self.start in ("rest", "motion") else float(self.drive.voltage_V[0])

    @property
    def acting_V(self) -> Array:
        """The voltage that acted while each row was read, before the row's own command did."""
        x = self.drive
        return acting_V(x.row_time_s, x.command_time_s, x.voltage_V, x.linear)

    @property
    def training(self) -> Mask:
        """Rows that a fit may use."""
        return self.usable & ~self.held_out

    @property
    def judging(self) -> Mask:
        """Rows that no fit sees and that choices are made on."""
        return self.usable & self.held_out & ~self.reported

    @property
    def reporting(self) -> Mask:
        """Rows that neither a fit nor a choice sees."""
        return self.usable & self.reported

    @property
    def searched(self) -> Mask:
        """Rows that fits and choices see."""
        return self.usable & ~self.reported

    def mirrored(self) -> "Observations":
        """Return the record as if it had been driven with its commands mirrored about the middle of their range.

        The levels, rates and duration are those of the record. Where it begins at rest, the plant stood at the first
        of these commands.
        """
        x = self.drive
        volts = float(np.min(self.command_V) + np.max(self.command_V)) - x.voltage_V
        command_s = x.command_time_s
        if self.start == "rest":
            before_s = command_s[0] - 3.0 * float(x.row_time_s[-1] - x.row_time_s[0])
            command_s, volts = np.concatenate([[before_s], command_s]), np.concatenate([volts[:1], volts])
        return replace(self, drive=replace(x, command_time_s=command_s, voltage_V=volts))

    @property
    def passes_zero(self) -> bool:
        """Whether no command, at which a plant that adds them up stands still, is within their range."""
        return bool(np.min(self.command_V) <= 0.0 <= np.max(self.command_V))

    def held_at_largest(self) -> "Observations":
        """Return the record as if its largest command had stood all the time, behind a long stand at its smallest."""
        volts = np.full_like(self.drive.voltage_V, float(np.max(self.command_V)))
        volts[0] = float(np.min(self.command_V))
        return replace(self, start="from_voltage", drive=replace(self.drive, voltage_V=volts))

    def without(self, outlying: Mask) -> "Observations":
        """Return the observations with more rows set aside."""
        return replace(self, usable=self.usable & ~outlying)


def have_same_zero(observations: Sequence[Observations]) -> bool:
    """Return whether one offset of the reading holds for several records."""
    return len(observations) > 1 and all(x.same_zero for x in observations)


FEW_STEPS = 2
NO_STEP = 1e-9
"""Of the largest command."""
# the slowest of the paper's actuator relaxes within a second
UNTIMED_HOLD_S = 12.0


def observe(record: Record, linear: bool = False, untimed: bool = False, smooth: bool = False) -> Observations:
    """Return the observations of a record: its clock starts at its first row.

    Where the times are only an order, every row is held until whatever relaxes has relaxed.
    """
    usable = np.isfinite(record.displacement_um)
    if untimed:
        times = UNTIMED_HOLD_S * np.arange(len(record), dtype=float)
        drive = Drive.of_rows(times + UNTIMED_HOLD_S, record.voltage_V, times)
        return _observations(drive, record.displacement_um, usable)
    start = record.time_s[0]
    times = record.time_s - start
    command = times if record.command_time_s is None else record.command_time_s - start
    drive = Drive(times, command, record.voltage_V, linear or smooth, smooth, exposure_s=record.exposure)
    return _observations(drive, record.displacement_um, usable)


def _observations(drive: Drive, measured_um: Array, usable: Mask) -> Observations:
    command_V = drive.voltage_V[-measured_um.size :]
    roles = held_out_and_reported(usable, command_V)
    return Observations(drive, measured_um, usable, *roles, first_folds=folds_of(usable))


def turns_plays(observations: Sequence[Observations]) -> bool:
    """Return whether the command of a record rises and falls by half of what it spans: every play is turned then."""
    return any(_turned_back(x.command_V) >= 0.5 * float(np.ptp(x.command_V)) > 0.0 for x in observations)


def _turned_back(command_V: Array) -> float:
    """Return the lesser of the largest rise and the largest fall of a command."""
    rise = np.max(command_V - np.minimum.accumulate(command_V))
    fall = np.max(np.maximum.accumulate(command_V) - command_V)
    return float(min(rise, fall))


def hardly_steps(observations: Sequence[Observations]) -> bool:
    """Return whether all that was commanded is a step or two one way: nothing shows whether responses add up."""
    return all(_steps_one_way(x) <= FEW_STEPS for x in observations)


def _steps_one_way(seen: Observations) -> float:
    """Return how often a command changes, what it stood at before included; inf where it turns back."""
    steps = np.diff(seen.drive.voltage_V)
    if seen.start == "rest":
        steps = np.append(steps, seen.drive.voltage_V[0])
    steps = steps[np.abs(steps) > NO_STEP * np.max(np.abs(seen.drive.voltage_V), initial=0.0)]
    return math.inf if np.any(steps > 0.0) and np.any(steps < 0.0) else float(steps.size)


def only_one_sine(observations: Sequence[Observations]) -> bool:
    """Return whether all that was commanded is one frequency at one amplitude: it distinguishes no memories."""
    return all(one_sine(x.time_s, x.command_V) for x in observations)
