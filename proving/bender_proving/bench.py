"""A bench that plays voltages and reads displacements, with what a case hides in it."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

from bender_loop.records.record import Record
from numpy.random import Generator, default_rng
from numpy.typing import ArrayLike

from bender_proving.records import beside, closed_loop, excitation, excitations, moved
from bender_proving.cases import outside, weak
from bender_proving.physics import sensor
from bender_proving.cases.case import Case
from bender_proving.chain import readings_um
from bender_proving.cases.effects import effect, of_stage
from bender_proving.records.excitation import Excitation
from bender_proving.records.frames import spoil
from bender_proving.cases.hidden import NOISE_UM, Hidden, Setting, log_uniform
from bender_proving.physics.lobatto import Array


def stream(entropy: int, purpose: str, number: int = 0) -> Generator:
    """The generator for one purpose of one case; streams of different purposes are independent."""
    return default_rng([entropy, zlib.crc32(purpose.encode()), number])


def excitation_stream(entropy: int, number: int = 0) -> Generator:
    """The generator for the excitation of record `number`."""
    return stream(entropy, "excitation", number)


@dataclass(frozen=True, slots=True)
class Bench:
    """The bench of a case. What is hidden stays the same from record to record, but for surroundings and chance.

    Attributes:
        case: what is hidden.
        linear: a gain in the place of equation (30).
    """

    case: Case
    linear: bool = False

    def excitation(self, number: int = 0) -> Excitation:
        """What the case plays: its own excitation (0), another rich one of the same sensor (1, 2, ...)."""
        case = self.case
        rng = excitation_stream(case.entropy, number)
        if number == 0 and case.weak is not None:
            return weak.played(case.weak, rng)
        if number == 0 and case.closed_loop:
            noise_um = NOISE_UM[case.sensor] * self.noise().standard_normal(closed_loop.ROWS)
            return closed_loop.played(rng, lambda plan: self._seen_um(plan, noise_um))
        if number == 0 and case.start != "rest":
            plan = excitations.begun(case.sensor, rng, case.start)
        else:
            plan = excitations.rich(case.sensor, rng, first=number == 0)
        if case.uneven:
            plan = excitation.uneven(plan, rng)
        return excitation.with_runner(plan, rng) if case.runner_delay else plan

    def hidden(self, number: int, setting: Setting) -> tuple[Hidden, ...]:
        """What is hidden in record `number`: the effects of the case, after the first with other surroundings."""
        if number == 0:
            return (*self.case.effects, *self._known)
        rng = stream(self.case.entropy, "surroundings", number)
        return (*(_renewed(item, setting, rng) for item in self.case.effects), *self._known)

    @property
    def _known(self) -> tuple[Hidden, ...]:
        """What the bench has and the model that is given has too: the lag of its sensor."""
        lag_s = self.case.given.lag_s
        lag = Hidden("sensor_lag", "one_pole", lag_s, (("tau_s", lag_s), ("second_tau_s", 0.0)))
        return (lag,) if lag_s > 0.0 else ()

    def clean(self, plan: Excitation, number: int = 0) -> Array:
        """The reading without noise and frames gone wrong, shape of the recorded rows; calibrated as the case says."""
        reading = self._true_um(plan, number)
        return self._calibrated(self._rounded(reading))

    def record(self, plan: Excitation, rng: Generator, number: int = 0) -> Record:
        """Play `plan` and record it; `rng` gives the noise and then the frames gone wrong."""
        case, rows = self.case, plan.recorded
        reading = self._true_um(plan, number)
        noisy = reading + NOISE_UM[case.sensor] * rng.standard_normal(len(reading))
        displacement = spoil(self._rounded(noisy), case.sensor, case.outlying, case.lost, rng)
        acting = None if plan.command_time_s is None else plan.command_time_s[rows]
        return Record(plan.time_s[rows], plan.voltage_V[rows], self._calibrated(displacement), command_time_s=acting)

    def with_columns(self, record: Record, plan: Excitation, columns: Sequence[str], number: int = 0) -> Record:
        """Return record `number`, which is of `plan`, with what instruments beside the sensor showed in its rows.

        Args:
            record: as `record` gives it.
            plan: what was played.
            columns: names of `beside.COLUMNS`.
            number: of the record.

        Raises:
            KeyError: there is no instrument for a column.
        """
        case, hidden = self.case, self.hidden(number, plan.setting)

        def shown(name: str) -> Array:
            bench, chance = stream(case.entropy, name), stream(case.entropy, f"{name} read", number)
            return beside.COLUMNS[name](plan, hidden, case.moved, bench, chance)

        return replace(record, **{name: shown(name) for name in columns})

    def play(self, time_s: ArrayLike, voltage_V: ArrayLike, rng: Generator, number: int = 1) -> Record:
        """Play any voltage profile (0 to 50 V, each value held to the next time) and record it at the sensor's rate.

        Raises:
            ValueError: the profile is not one; the message says what was found.
        """
        return self.record(excitation.played(self.case.sensor, time_s, voltage_V), rng, number)

    def noise(self, number: int = 0) -> Generator:
        """The generator for the noise of the case's own records."""
        return stream(self.case.entropy, "noise", number)

    def _true_um(self, plan: Excitation, number: int) -> Array:
        hidden = self.hidden(number, plan.setting)
        reading = readings_um(plan.commands, hidden, self.linear)[plan.recorded]
        if self.case.moved == 0.0:
            return reading
        nominal = readings_um(plan.commands, linear=self.linear)[plan.recorded]
        return reading + self.case.moved * moved.moved_um(reading, nominal, plan, stream(self.case.entropy, "moved"))

    def _seen_um(self, plan: Excitation, noise_um: Array) -> Array:
        """What the controller reads: nan in the rows beyond the plan's end has no place in it."""
        reading = self._true_um(plan, 0)
        return self._calibrated(self._rounded(reading + noise_um[: len(reading)]))

    def _rounded(self, reading_um: Array) -> Array:
        for item in of_stage(self.case.effects, "sensor"):
            reading_um = sensor.round_rows(item, reading_um)
        return reading_um

    def _calibrated(self, reading_um: Array) -> Array:
        return self.case.gain * reading_um + self.case.offset_um


def _renewed(item: Hidden, setting: Setting, rng: Generator) -> Hidden:
    entry = effect(item.id)
    if entry.stage != "surroundings":
        return outside.renewed(item, rng)
    low, high = entry.ranges[setting.sensor]
    size = min(high, max(low, abs(item.magnitude) * log_uniform(rng, 0.5, 2.0)))
    sign = -1.0 if entry.signed and rng.random() < 0.5 else 1.0
    return entry.hide(item.form, sign * size, setting, rng)
