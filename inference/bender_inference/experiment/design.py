"""The next experiment: the profile under which the rivals differ most, as far as simulation can tell.

Each candidate profile is simulated with every rival as it was fitted. One rival's readings are then taken for the
measurement, and every other one is fitted to them: its residual over the noise is what the experiment would
show. The profile whose closest pair of rivals is furthest apart wins, measured by the noise or, where that is more, by
what the rivals themselves leave unexplained.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bender_compiled.parallel_map import parallel_map
from bender_compiled.simulation import Drive, Simulator
from bender_inference.experiment.profiles import (
    CAMERA_STEP_S,
    PATTERNS,
    Limits,
    Sine,
    ramp_and_frequencies,
    random_levels,
    within,
)
from bender_inference.fitting.fit_problem import problem_of
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import fit
from bender_inference.records.observations import Observations
from bender_plant.model import Model, ModelError
from bender_report.wording import figure, quantity

Array = NDArray[np.float64]
RANDOM_DESIGNS = 6
REFITTED = 3
SWEPT = "an amplitude ramp and two other frequencies"
SWEPT_FARTHER = "an amplitude ramp over the whole range and two other frequencies"
# rms over the noise by which rivals must differ for a profile to be taken without a look at others
ENOUGH = 10.0
# the same for profiles that last no longer than the records
CLEARLY = 1.0
# times longer than the records: profiles are hastened
FAR_SHORTER = 2.0
MOST_ROWS = 50_000
# simulated for all profiles together before no further one is tried; a million take some 0.2 s of one core
MOST_WORK_SUBSTEPS = 6e7
# rivals that differ by less than this part of the noise cannot be told apart by any length of such a record
TELLING = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Experiment:
    """A designed experiment.

    Attributes:
        pattern: what kind of profile it is.
        time_s: (n,) rows.
        voltage_V: (n,) commands, held from row to row.
        distance_um: rms by which the closest two rivals would still differ after a refit.
        noise_um: noise floor that this stands against.
        unexplained_um: rms that the best of them would leave, were it the same part of the gap as in the records.
    """

    pattern: str
    time_s: Array
    voltage_V: Array
    distance_um: float
    noise_um: float
    unexplained_um: float = 0.0

    @property
    def tells_apart(self) -> bool:
        """Whether any length of such a record could distinguish the rivals.

        Of what all of them leave, by chance, one may take up as much as they differ by, however long the record is.
        """
        return self.distance_um >= max(TELLING * self.noise_um, self.unexplained_um)

    @property
    def contrast(self) -> float:
        """How far the rivals are apart beside the noise, or beside what they leave where that is more."""
        least_um = max(self.noise_um, self.unexplained_um)
        return self.distance_um / least_um if least_um else math.inf if self.distance_um else 0.0

    @property
    def why(self) -> str:
        """The reason in one sentence."""
        ends = f"{figure(float(self.voltage_V.min()))} to {quantity(float(self.voltage_V.max()), 'V')}"
        # one of several drawn at random has a number
        played = f"{self.pattern.rstrip(' 0123456789')} ({quantity(float(self.time_s[-1]), 's', 2)}, {ends})"
        times = self.distance_um / self.noise_um if self.noise_um else float("inf")
        beside = f"{quantity(self.distance_um, 'um', 2)} rms, {figure(times, 2)} times the noise floor"
        if self.distance_um < self.unexplained_um:
            beside += ", which is small compared with what none of them explains"
        if not self.tells_apart:
            return (
                f"no command that was tried would distinguish the rivals: with the best one, {played}, they would "
                f"differ by {beside}"
            )
        return (
            f"{played} would distinguish the rivals: they would differ by {beside}, even with one fitted to the other"
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Played:
    """A profile as the rivals answer it.

    Attributes:
        drive: of the profile.
        distance_um: of the closest two rivals, as they stand.
        readings: of every rival.
        gap_um: what the model as given leaves of the best one's readings.
        work_substeps: that were simulated.
    """

    drive: Drive
    distance_um: float
    readings: list[Array]
    gap_um: float
    work_substeps: int

    def named(self, pattern: str, left_um: float, noise_um: float, unexplained: float) -> Experiment:
        """Return the profile as an experiment.

        Args:
            pattern: of the profile, in words.
            left_um: residual of the closest pair of rivals, one refitted to the other.
            noise_um: of the readings.
            unexplained: part of the gap that no rival explains.
        """
        drive = self.drive
        return Experiment(pattern, drive.row_time_s, drive.voltage_V, left_um, noise_um, unexplained * self.gap_um)


def _rms_apart(a: Array, b: Array) -> float:
    """Return the rms distance between two courses, gain and offset solved for."""
    line = np.stack([b, np.ones_like(b)], axis=1)
    left = a - line @ np.linalg.lstsq(line, a, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))


def _played(base: Model, profile: Array, step_s: float, rivals: Sequence[Hypothesis]) -> _Played:
    """Play a profile to every rival as it stands, and to the model as given."""
    drive = Drive.of_rows(step_s * np.arange(profile.size, dtype=np.float64), profile)
    simulator = Simulator(drive, coarser=3.0)
    try:
        readings = [simulator.run(rival.model(base)).reading_um for rival in rivals]
    except (ModelError, ArithmeticError):
        return _Played(drive, 0.0, [], 0.0, simulator.simulated)
    distances = [_rms_apart(a, b) for i, a in enumerate(readings) for b in readings[i + 1 :]]
    gap_um = _gap_um(simulator, base, readings[0])
    return _Played(drive, min(distances, default=0.0), readings, gap_um, simulator.simulated)


def _gap_um(simulator: Simulator, base: Model, reading_um: Array) -> float:
    """Return the rms that the model as given leaves of a reading; 0 where it runs away."""
    try:
        return _rms_apart(reading_um, simulator.run(base).reading_um)
    except (ModelError, ArithmeticError):
        return 0.0


def _after_refit(base: Model, played: _Played, rivals: Sequence[Hypothesis]) -> tuple[float, int]:
    """Return the smallest rms that a rival leaves of another one's readings once fitted to them, and the sub-steps."""
    drive, readings = played.drive, played.readings
    everything = np.ones(drive.row_time_s.size, dtype=bool)
    benches = [problem_of(base, (Observations(drive, x, everything, ~everything, ~everything),)) for x in readings]
    pairs = [(bench, rival) for i, bench in enumerate(benches) for j, rival in enumerate(rivals) if i != j]
    fits = parallel_map(lambda pair: fit(*pair, most_evaluations=6), pairs)
    left_um = min((math.sqrt(x.training_square / drive.row_time_s.size) for x in fits if x is not None), default=0.0)
    return left_um, sum(x.work_substeps for x in benches)


def _sweeps(sine: Sine | None, bounds: Limits) -> dict[str, Sine]:
    """Return the sines to sweep: that of the record, and one over all that the bench allows."""
    if sine is None:
        return {}
    middle, half = 0.5 * (bounds.low_V + bounds.high_V), 0.5 * (bounds.high_V - bounds.low_V)
    return {SWEPT: sine, SWEPT_FARTHER: replace(sine, middle_V=middle, amplitude_V=half)}


def design(
    base: Model,
    rivals: Sequence[Hypothesis],
    noise_um: float,
    step_s: float,
    rng: np.random.Generator,
    limits: Limits | None = None,
    sine: Sine | None = None,
    unexplained: float = 0.0,
    record_s: float = math.inf,
) -> Experiment | None:
    """Return the profile that separates the rivals best; None where no candidate separates them at all.

    After records of one sine, its amplitude growing and other frequencies are enough where they separate the rivals
    by far: a rig that plays sines can play them. Voltages that it has seen go before the whole range of the bench.
    Of a device whose simulation takes long, not all profiles are tried.

    Args:
        base: the model as given.
        rivals: hypotheses with their fitted numbers, two or more.
        noise_um: noise floor of the records.
        step_s: time between rows, that of the records.
        rng: for the random designs.
        limits: of the bench; 0 to 50 V where None.
        sine: that the records were driven with; None for others.
        unexplained: part of the gap (rms) that the best rival leaves above the noise.
        record_s: length of the longest record; of one that is far shorter than the profiles last, or far longer with
            rows far apart, profiles of that length are tried first.
    """
    bounds = limits or Limits()
    for name, swept in _sweeps(sine, bounds).items():
        played = _played(base, within(ramp_and_frequencies(step_s, swept), bounds, step_s), step_s, rivals)
        left, _ = _after_refit(base, played, rivals) if played.distance_um else (0.0, 0)
        found = played.named(name, left, noise_um, unexplained)
        if found.distance_um > ENOUGH * noise_um and found.tells_apart:
            return found
    best: Experiment | None = None
    work = 0
    for profiles in _profiles(rng, step_s, bounds, record_s):
        candidates: list[tuple[str, _Played]] = []
        for name, x in profiles:
            if candidates and work > MOST_WORK_SUBSTEPS:
                break
            candidates.append((name, _played(base, within(x, bounds, step_s), step_s, rivals)))
            work += candidates[-1][1].work_substeps
        candidates.sort(key=lambda x: -x[1].named(x[0], x[1].distance_um, noise_um, unexplained).contrast)
        for found, substeps in _refitted(base, candidates, rivals, noise_um, unexplained):
            work += substeps
            best = found if best is None or found.contrast > best.contrast else best
            if work > MOST_WORK_SUBSTEPS:
                return best
        if best is not None and best.contrast >= CLEARLY:
            break
    return best


def _refitted(
    base: Model,
    candidates: Sequence[tuple[str, _Played]],
    rivals: Sequence[Hypothesis],
    noise_um: float,
    unexplained: float,
) -> Iterator[tuple[Experiment, int]]:
    """Yield candidates with the rivals refitted, and the sub-steps of that: the first few, or until one decides."""
    decides = True
    for k, (name, played) in enumerate(candidates):
        if k >= REFITTED and decides:
            return
        if played.distance_um == 0.0:
            continue
        left, substeps = _after_refit(base, played, rivals)
        found = played.named(name, left, noise_um, unexplained)
        decides = found.tells_apart if k == 0 else decides or found.tells_apart
        yield found, substeps


def _profiles(
    rng: np.random.Generator, step_s: float, bounds: Limits, record_s: float
) -> Iterator[list[tuple[str, Array]]]:
    """Yield the profiles that are compared: hastened or slowed down to the length of the records first.

    What shows in a record of a second is quick, as a rule, and so is what distinguishes its causes; what shows in one
    of hours is slow. Profiles are slowed down by no more than rows of the records are apart beside those of a camera:
    a quick device that is recorded for long stays quick.
    """
    # patterns start at 0: below it they would be cut off
    low, height = min(bounds.low_V, 0.0), bounds.high_V - min(bounds.low_V, 0.0)
    makers = dict(PATTERNS) | {
        f"random levels {k + 1}": lambda step_s, top: random_levels(rng, step_s, top) for k in range(RANDOM_DESIGNS)
    }
    lengths_s = {name: maker(CAMERA_STEP_S, height).size * CAMERA_STEP_S for name, maker in PATTERNS.items()}
    longest_s = max(lengths_s.values())
    haste = longest_s / record_s
    slowness = min(step_s / CAMERA_STEP_S, record_s / longest_s)
    first = haste if haste >= FAR_SHORTER else 1.0 / slowness if FAR_SHORTER <= slowness < math.inf else 1.0
    # as many rows as can be simulated with every rival
    least = longest_s / (MOST_ROWS * step_s)
    for times in dict.fromkeys(max(x, least) for x in (first, 1.0)):
        yield [(name, low + maker(times * step_s, height)) for name, maker in makers.items()]
