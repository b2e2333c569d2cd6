"""What a hypothesis is fitted to: the base model, the records, and the readings that a hypothesis gives for them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bender_compiled.simulation import Simulator
from bender_effects.form import Values
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.records.observations import Array, Observations, have_same_zero
from bender_plant.model import Model, ModelError

# how much longer the sub-steps of fits and of scans are than those of the FMU: a tip of 30 µm is off by less than a
# nanometre, by less than ten
COARSER = 8.0
ROUGH = 16.0
# of one simulation; a search takes thousands of them
MOST_SUBSTEPS = 2.5e6
MOST_OF_A_FIT = 4.0 * MOST_SUBSTEPS
"""Of one simulation of a fit, whose times may fall far below a row: beyond it, the hypothesis has failed."""
COARSE_TURNS, HALVINGS = 30, 30
SETTLED = 1e-6
"""Of the square that coarse readings leave: steps that take less off end the search for their line."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """Gain and offset of the reading, one offset for each record; alike where these have the same zero."""

    gain: float
    offsets_um: Values


@dataclass(frozen=True, slots=True, eq=False)
class FitProblem:
    """The base model and the observations, with one simulator for each record; see `problem_of`.

    Attributes:
        base: the model as given.
        observations: of one bench.
        fine: simulators of fits, one for each record.
        rough: simulators of scans.
    """

    base: Model
    observations: tuple[Observations, ...]
    fine: tuple[Simulator, ...]
    rough: tuple[Simulator, ...]

    @property
    def all_rows(self) -> int:
        """Readings that fits and choices see."""
        return sum(int(x.searched.sum()) for x in self.observations)

    @property
    def work_substeps(self) -> int:
        """Sub-steps of all simulations so far."""
        return sum(x.simulated for x in (*self.fine, *self.rough))

    def square_with_steps(self, residuals: Sequence[Array]) -> float:
        """Return the sum of squares on the training rows with the steps of coarse readings in it, as scans promise it.

        Args:
            residuals: (n,) of every record, told beyond the steps; within one, a reading is off by a twelfth of its
                square.
        """
        total = 0.0
        for r, x in zip(residuals, self.observations, strict=True):
            beyond, half = np.abs(r[x.training]), x.half_step_um
            total += float(np.sum(np.where(beyond > 0.0, (beyond + half) ** 2, half**2 / 3.0)))
        return total

    def observing(self, observations: Sequence[Observations]) -> "FitProblem":
        """Return the problem with other readings of the same records; simulators go along where the drive is kept."""
        seen = tuple(observations)
        same = [x.drive is y.drive for x, y in zip(seen, self.observations, strict=True)]
        fine = zip(same, self.fine, seen, strict=True)
        rough = zip(same, self.rough, seen, strict=True)
        return FitProblem(
            self.base,
            seen,
            tuple(old if kept else _simulator(x, COARSER) for kept, old, x in fine),
            tuple(old if kept else _simulator(x, ROUGH) for kept, old, x in rough),
        )

    def readings(self, hypothesis: Hypothesis, roughly: bool = False) -> list[Array] | None:
        """Return the simulated readings of every record, None where the model cannot be or runs away."""
        try:
            runs = list(enumerate(self.rough if roughly else self.fine))
            own = hypothesis.has_surroundings
            models = [hypothesis.model(self.base, k) for k in range(len(runs) if own else 1)]
            return [simulator.run(models[k if own else 0]).reading_um for k, simulator in runs]
        except (ModelError, ArithmeticError):
            return None

    def calibrate(self, readings: list[Array]) -> Calibration:
        """Solve for gain and offsets by least squares on the training rows."""
        return calibrated(self.observations, readings)

    def residuals(self, readings: list[Array], calibration: Calibration) -> list[Array]:
        """Return measured minus calibrated simulation for every record, NaN where lost."""
        return [
            x.beyond(x.measured_um - calibration.gain * y - offset)
            for x, y, offset in zip(self.observations, readings, calibration.offsets_um, strict=True)
        ]


def _simulator(seen: Observations, coarser: float) -> Simulator:
    return Simulator(seen.drive, coarser=coarser, most_substeps=MOST_OF_A_FIT)


def problem_of(base: Model, observations: Sequence[Observations]) -> FitProblem:
    """Return the fit problem of a model and the records of one bench."""
    seen = tuple(observations)
    fine = tuple(_simulator(x, COARSER) for x in seen)
    return FitProblem(base, seen, fine, tuple(_simulator(x, ROUGH) for x in seen))


def calibrated(observations: Sequence[Observations], readings: Sequence[Array]) -> Calibration:
    """Return gain and offsets of simulated readings (n,) of every record by least squares on the training rows.

    A coarse reading counts by how far the line lies beyond what it allows.
    """
    targets = [x.measured_um[x.training] for x in observations]
    simulated = [y[x.training] for y, x in zip(readings, observations, strict=True)]
    half_steps_um = [x.half_step_um for x in observations]
    if not have_same_zero(observations):
        return _line(simulated, targets, half_steps_um)
    halves = np.repeat(half_steps_um, [d.size for d in targets])
    found = _line([np.concatenate(simulated)], [np.concatenate(targets)], [halves if halves.any() else 0.0])
    return replace(found, offsets_um=found.offsets_um * len(observations))


def _line(simulated: list[Array], targets: list[Array], half_steps_um: Sequence[float | Array]) -> Calibration:
    found = straight_line(simulated, targets)
    if all(np.all(x == 0.0) for x in half_steps_um):
        return found
    return line_through_steps(simulated, targets, half_steps_um, found)


def straight_line(simulated: list[Array], targets: list[Array]) -> Calibration:
    """Return the gain common to all records and the offset of each; what hardly moves leaves the gain at 1."""
    means = [(float(y.mean()), float(d.mean())) for y, d in zip(simulated, targets, strict=True)]
    y = np.concatenate([a - mean for a, (mean, _) in zip(simulated, means, strict=True)])
    d = np.concatenate([b - mean for b, (_, mean) in zip(targets, means, strict=True)])
    power = float(y @ y)
    gain = float(y @ d) / power if power > 1e-18 * y.size else 1.0
    return Calibration(gain, tuple(b - gain * a for a, b in means))


def line_through_steps(
    simulated: list[Array], targets: list[Array], half_steps_um: Sequence[float | Array], start: Calibration
) -> Calibration:
    """Return gain and offsets for which coarse readings lie least beyond their steps, in square.

    That square is convex in them, a parabola as long as the same readings lie beyond: Newton's step leads to the bottom
    of the parabola, halved while it leads up (semismooth Newton, Qi and Sun 1993, doi 10.1007/BF01581275).
    """
    now = np.array([start.gain, *start.offsets_um])

    def beyond(line: Array) -> list[Array]:
        left = (d - line[0] * y - c for y, d, c in zip(simulated, targets, line[1:], strict=True))
        return [r - np.clip(r, -half, half) for r, half in zip(left, half_steps_um, strict=True)]

    left = beyond(now)
    square = _square(left)
    for _ in range(COARSE_TURNS):
        step = _newton_step(simulated, left)
        for _ in range(HALVINGS):
            after = beyond(now + step)
            if _square(after) < square:
                break
            step = 0.5 * step
        else:
            break
        now, left, before, square = now + step, after, square, _square(after)
        if before - square <= SETTLED * before:
            break
    return Calibration(float(now[0]), tuple(float(x) for x in now[1:]))


def _newton_step(simulated: list[Array], left: list[Array]) -> Array:
    """Return the change of gain and offsets that takes most off what lies beyond, the least one where many do."""
    count = len(simulated) + 1
    normal, right = np.zeros((count, count)), np.zeros(count)
    for k, (y, r) in enumerate(zip(simulated, left, strict=True), start=1):
        rows = r != 0.0
        own, off = y[rows], r[rows]
        normal[0, 0] += own @ own
        normal[0, k] = normal[k, 0] = own.sum()
        normal[k, k] = own.size
        right[0] += own @ off
        right[k] = off.sum()
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    return np.linalg.lstsq(normal / np.outer(size, size), right / size, rcond=1e-12)[0] / size


def _square(left: list[Array]) -> float:
    return float(sum(r @ r for r in left))
