"""A bench of `bender_proving` as an investigation meets it, in virtual time: nothing is waited for.

It stands for the bench behind the guard: a reading beyond the travel and a loop that oscillates end a play, as the
guard and the runner would end it. Every play starts from rest, with the surroundings that the case says.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bender_hil.guard.settings import GuardSettings
from bender_hil.runner.following_program import FollowingLoop
from bender_hil.runner.oscillation import OscillationWatch, ranges_of
from bender_hil.runner.program import ClosedLoop
from bender_hil.runner.voltages import Voltages
from bender_investigate.bench_port import Controller, Played
from bender_investigate.safety import SLEW_SHARE, Allowed, rows_of
from bender_loop.control.pid import Limits
from bender_loop.control.references import Profile
from bender_loop.fmu.followed_model import Loop
from bender_loop.fmu.follower import Follower
from bender_loop.records.record import Record, read_record, write_record
from bender_proving import Bench, Case
from bender_proving.cases.hidden import Sensor
from bender_proving.records import excitation
from bender_proving.records.excitation import RATE_HZ, Excitation

RECORD = "record.csv"
LOOP_HZ = 30.0
LATENCY_FRAMES = 1
"""Between a frame and the command that rests on it: reading out, finding the tip, the wire to the supply."""
LOOP_GUARD = GuardSettings()
"""Of the loop: what the guard holds a bench to unless told otherwise."""
LIMITS, LOOP_SLEW_V_PER_S = Limits(LOOP_GUARD.minimum_V, LOOP_GUARD.maximum_V), SLEW_SHARE * LOOP_GUARD.slew_V_per_s
GUARDS: dict[Sensor, GuardSettings] = {
    "camera": replace(LOOP_GUARD, slew_V_per_s=2000.0, travel_um=(-60.0, 120.0)),
    "vibrometer": replace(LOOP_GUARD, slew_V_per_s=200_000.0, travel_um=(-60.0, 120.0)),
}
"""Of a profile: a supply that may jump within a row, and a travel that leaves room for the tip to ring."""
_SLACK = 1e-6


def allowed_by(guard: GuardSettings, rate_Hz: float) -> Allowed:
    """Return the limits of a guard as an investigation meets them."""
    travel_um = guard.travel_um[0], guard.travel_um[1]
    return Allowed(guard.minimum_V, guard.maximum_V, guard.slew_V_per_s, guard.burst_s, travel_um, rate_Hz)


@dataclass(slots=True)
class VirtualBench:
    """One hidden bench.

    Attributes:
        case: what is hidden.
        seed: of the noise.
        beyond: what went beyond the limits, a sentence each: nothing, if the investigation keeps its word.
        plays: so far.
    """

    case: Case
    seed: int = 0
    beyond: list[str] = field(default_factory=list)
    plays: int = 0

    @property
    def guard(self) -> GuardSettings:
        """The limits of a profile."""
        return GUARDS[self.case.sensor]

    @property
    def allowed(self) -> Allowed:
        """The limits, and the rate of the sensor."""
        return allowed_by(self.guard, RATE_HZ[self.case.sensor])

    @property
    def loop_travel_um(self) -> tuple[float, float]:
        """Where a closed loop is ended, which is narrower than the travel of a profile."""
        return LOOP_GUARD.travel_um[0], LOOP_GUARD.travel_um[1]

    def facts(self) -> dict[str, Any]:
        """Return its name, which says nothing of what is hidden."""
        return {"bench": self.case.id}

    def play(self, folder: Path, voltages: Voltages) -> Played:
        """Play a profile at the rows of the sensor."""
        self.plays += 1
        time_s, levels_V = rows_of(voltages, self.allowed.rate_Hz)
        self._watch(time_s, levels_V)
        plan = Excitation(self.case.sensor, time_s, np.clip(levels_V, self.guard.minimum_V, self.guard.maximum_V))
        rng = np.random.default_rng([self.seed, self.plays])
        if self.case.uneven:
            plan = excitation.uneven(plan, rng)
        if self.case.runner_delay:
            plan = excitation.with_runner(plan, rng)
        record = Bench(self.case).record(plan, rng)
        return self._ended(folder, record)

    def follow(self, folder: Path, reference: Profile, controller: Controller, duration_s: float) -> Played:
        """Follow set-points with the PID block, alone or with its model, at 30 Hz."""
        self.plays += 1
        rng = np.random.default_rng([self.seed, self.plays])
        record, trip = self.looped(reference, controller, duration_s, rng)
        write_record(folder / RECORD, record)
        return Played(record, float(record.time_s[-1]), trip)

    def recovered(self, folder: Path) -> Played | None:
        """Return what was played into the folder."""
        if not (folder / RECORD).exists():
            return None
        record = read_record(folder / RECORD)
        return Played(record, float(record.time_s[-1]))

    def looped(
        self, reference: Profile, controller: Controller, duration_s: float, rng: np.random.Generator | None
    ) -> tuple[Record, str | None]:
        """Run the loop; returns its record, and why it was ended before its time.

        The bench has no state to step on from: each tick computes it anew from rest.

        Args:
            reference: the set-points.
            controller: gains, alone or with the model that they follow.
            duration_s: of the loop.
            rng: of the noise; None for a sensor without noise.
        """
        gains, model, fmu = controller.gains, controller.model, controller.fmu
        if model is None or fmu is None:
            alone = ClosedLoop(reference, gains, LIMITS, LOOP_SLEW_V_PER_S, duration_s)
            return self._looped(alone, duration_s, rng)
        loop = Loop(1.0 / LOOP_HZ, LIMITS, LOOP_SLEW_V_PER_S, LATENCY_FRAMES)
        with Follower(fmu, model, gains, loop) as follower:
            following = FollowingLoop(reference, follower, gains, model, fmu, loop, duration_s)
            return self._looped(following, duration_s, rng)

    def _looped(
        self, program: ClosedLoop | FollowingLoop, duration_s: float, rng: np.random.Generator | None
    ) -> tuple[Record, str | None]:
        bench, period_s = Bench(self.case), 1.0 / LOOP_HZ
        watch = OscillationWatch(ranges_of(LOOP_GUARD))
        count = max(2, int(duration_s * LOOP_HZ))
        time_s = np.arange(count + 1) / LOOP_HZ
        volts, tips, aims = np.zeros(count + 1), np.full(count, np.nan), np.zeros(count)
        trip = None
        rows = 0
        for k in range(count):
            plan = Excitation(self.case.sensor, time_s[: k + 2], volts[: k + 2])
            readings = bench.clean(plan) if rng is None else bench.record(plan, rng).displacement_um
            tip_um = float(readings[k])
            tips[k], rows = tip_um, k + 1
            decision = program.decide(float(time_s[k]), period_s, float(tips[max(k - LATENCY_FRAMES, 0)]))
            volts[k:], aims[k] = decision.voltage_V, decision.setpoint_um or 0.0
            trip = _tripped(tip_um, self.loop_travel_um) or watch.add(aims[k], tip_um, decision.voltage_V)
            if trip is not None:
                break
        rows = max(rows, 2)
        record = Record(time_s[:rows], volts[:rows], tips[:rows], setpoint_um=aims[:rows])
        return record, trip

    def _ended(self, folder: Path, record: Record) -> Played:
        """Write the record as far as the guard lets it go."""
        trip = None
        for row, tip_um in enumerate(record.displacement_um.tolist()):
            trip = _tripped(tip_um, self.allowed.travel_um)
            if trip is not None:
                self.beyond.append(trip)
                kept: dict[str, Any] = {k: column[: max(2, row + 1)] for k, column in record.columns().items()}
                record = Record(**kept)
                break
        write_record(folder / RECORD, record)
        return Played(record, float(record.time_s[-1] - record.time_s[0]), trip)

    def _watch(self, time_s: np.ndarray, levels_V: np.ndarray) -> None:
        low_V, high_V = float(levels_V.min()), float(levels_V.max())
        if low_V < self.guard.minimum_V - _SLACK or high_V > self.guard.maximum_V + _SLACK:
            self.beyond.append(f"{low_V:g} to {high_V:g} V were commanded")
        change = np.abs(np.diff(levels_V, prepend=0.0))
        most_V = self.guard.slew_V_per_s * min(float(time_s[1] - time_s[0]), self.guard.burst_s)
        if float(change.max()) > most_V + _SLACK:
            self.beyond.append(f"a change of {float(change.max()):g} V from row to row was commanded")


def _tripped(tip_um: float, travel_um: tuple[float, float]) -> str | None:
    low_um, high_um = travel_um
    if np.isfinite(tip_um) and not low_um <= tip_um <= high_um:
        return f"travel: the tip is at {tip_um:.2f} µm, allowed: {low_um:g} ... {high_um:g} µm"
    return None
