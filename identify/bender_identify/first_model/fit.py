"""One structure fitted by the error of the simulated readings; gain and offsets are solved for inside.

The search runs in coordinates in which every number may take any value: logarithms of times and frequencies, a logistic
of the damping ratio, the share and the delay as they are. The gain is common to all records, every record has an
offset of its own (variable projection, Golub and Pereyra 1973).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Simulator
from bender_identify.first_model.structures import (
    LEAST_DAMPING,
    LEAST_PERIODS,
    LONGEST_DELAY_S,
    LONGEST_LAG_S,
    MOST_DAMPING,
    HIGHEST_Hz,
    LOWEST_Hz,
    Structure,
)
from bender_identify.fitting.correlation import correlation_rows
from bender_identify.records.experiment import Experiment
from bender_plant.model import Model
from bender_plant.parameter import ModelError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CANNOT_BE = (ModelError, ArithmeticError, np.linalg.LinAlgError)
"""What says that a structure and records do not go together: a number out of the bounds of its block, a plant that
runs away, equations that cannot be solved."""
COARSER = 3.0
"""How much longer the sub-steps of a search are than those of the plant; some 1e-4 of the reading."""
MOST_EVALUATIONS = 60
SHORTEST_LAG_S, SHORTEST_OF_A_ROW = 1e-9, 1e-2
MOST_OF_A_RECORD, MOST_OF_A_CYCLE = 0.2, 0.25
"""Of a delay; one of more than a quarter of a cycle is a phase, of which a loop has one as well."""
HIGHEST_PER_ROW = 0.75
"""The highest frequency of a mode, in periods per row: half more than the Nyquist frequency."""
SLOPE_STEP = 1e-4
"""Step of the slopes in the coordinates of the search: a ten-thousandth of a time, of a frequency, of a delay unit."""


@dataclass(frozen=True, slots=True, eq=False)
class FitTask:
    """Records ready to be fitted.

    Attributes:
        experiments: the records.
        simulators: one for each of them.
        delay_unit_s: what a delay is counted in, the usual time between rows of the quickest record.
    """

    experiments: tuple[Experiment, ...]
    simulators: tuple[Simulator, ...]
    delay_unit_s: float

    @classmethod
    def of(cls, experiments: Sequence[Experiment], rough: bool = False) -> "FitTask":
        """Return the task of these records; a rough one follows a smooth input less closely, for a search."""
        simulators = tuple(Simulator(x.rough_drive if rough else x.drive, coarser=COARSER) for x in experiments)
        unit = min(float(np.median(np.diff(x.time_s))) for x in experiments)
        return cls(tuple(experiments), simulators, unit)

    @property
    def duration_s(self) -> float:
        """How long the longest record is."""
        return max(float(np.ptp(x.time_s)) for x in self.experiments)

    @property
    def longest_delay_s(self) -> float:
        """The longest delay that is sought: a part of the record, and of a cycle that is repeated all the time."""
        cycles = [x.excitation.period_s for x in self.experiments if x.excitation.period_s is not None]
        longest = MOST_OF_A_RECORD * self.duration_s
        if len(cycles) == len(self.experiments):
            longest = min(longest, max(MOST_OF_A_CYCLE * max(cycles), 2.0 * self.delay_unit_s))
        return min(longest, LONGEST_DELAY_S)

    def simulated(self, structure: Structure, values: Sequence[float]) -> list[Array] | None:
        """Return the readings (n,) of every record at gain 1, None where the plant cannot be simulated so."""
        try:
            return self.readings(structure.model(values))
        except (ModelError, ArithmeticError):
            return None

    def readings(self, model: Model) -> list[Array]:
        """Return the readings (n,) of a plant over every record.

        Raises:
            ArithmeticError: the plant runs away.
        """
        runs = [x.run(model).reading_um for x in self.simulators]
        return [y[x.lead_rows :] for y, x in zip(runs, self.experiments, strict=True)]


@dataclass(frozen=True, slots=True, eq=False)
class FirstFit:
    """A structure with its numbers.

    Attributes:
        structure: what it consists of.
        values: its numbers, in the order of `structure.names`.
        gain: static gain, units of the reading per unit of the input.
        offsets: constant of the reading in every record.
        residuals: measured minus simulated for every record (n,), NaN where a reading was lost.
        std: standard deviations of values and gain, correlation of the residual allowed for; inf where unknown.
    """

    structure: Structure
    values: tuple[float, ...]
    gain: float
    offsets: tuple[float, ...]
    residuals: tuple[Array, ...]
    std: tuple[float, ...] = ()

    def square(self, masks: Sequence[Mask]) -> float:
        """Return the sum of squared residuals on rows of every record."""
        return float(sum(np.sum(r[m] ** 2) for r, m in zip(self.residuals, masks, strict=True)))


def to_search(structure: Structure, values: Sequence[float], task: FitTask) -> Array:
    """Return the numbers of a structure in the coordinates of the search."""
    return np.array([_inward(n, v, task) for n, v in zip(structure.names, values, strict=True)])


def from_search(structure: Structure, point: Array, task: FitTask) -> tuple[float, ...]:
    """Return the numbers that a point of the search stands for, within their bounds."""
    return tuple(_outward(n, float(p), task) for n, p in zip(structure.names, point, strict=True))


def _inward(name: str, value: float, task: FitTask) -> float:
    if name.startswith("damping"):
        part = (value - LEAST_DAMPING) / (MOST_DAMPING - LEAST_DAMPING)
        part = min(max(part, 1e-6), 1.0 - 1e-6)
        return math.log(part / (1.0 - part))
    if name.startswith("share"):
        return value
    if name == "delay_s":
        return value / task.delay_unit_s
    return math.log(value)


def _outward(name: str, point: float, task: FitTask) -> float:
    if name.startswith("damping"):
        part = 1.0 / (1.0 + math.exp(-min(max(point, -40.0), 40.0)))
        return LEAST_DAMPING + (MOST_DAMPING - LEAST_DAMPING) * part
    if name.startswith("share"):
        return min(max(point, -1.0), 1.0)
    if name == "delay_s":
        return min(max(point * task.delay_unit_s, 0.0), task.longest_delay_s)
    # a quicker lag moves no reading, and takes endless sub-steps to simulate
    low, high = max(SHORTEST_LAG_S, SHORTEST_OF_A_ROW * task.delay_unit_s), min(LONGEST_LAG_S, 3.0 * task.duration_s)
    if name.startswith("frequency"):
        # a mode far above the rate of the rows shows in no reading, and takes endless sub-steps to simulate
        low = max(LOWEST_Hz, LEAST_PERIODS / task.duration_s)
        high = min(HIGHEST_Hz, HIGHEST_PER_ROW / task.delay_unit_s)
    return math.exp(min(max(point, math.log(low)), math.log(high)))


def solved(task: FitTask, simulated: Sequence[Array], masks: Sequence[Mask]) -> tuple[float, tuple[float, ...]]:
    """Return the gain and the offset of every record that meet the readings best on the given rows."""
    pairs = [(y[m], x.measured_um[m]) for y, x, m in zip(simulated, task.experiments, masks, strict=True)]
    above = sum(float((y - y.mean()) @ (d - d.mean())) for y, d in pairs if y.size)
    below = sum(float((y - y.mean()) @ (y - y.mean())) for y, _ in pairs if y.size)
    gain = above / below if below > 0.0 else 0.0
    return gain, tuple(float(d.mean() - gain * y.mean()) if y.size else 0.0 for y, d in pairs)


def evaluated(task: FitTask, structure: Structure, values: Sequence[float], masks: Sequence[Mask]) -> FirstFit | None:
    """Return a structure with these numbers, gain and offsets solved for on the given rows; None where it runs away."""
    simulated = task.simulated(structure, values)
    if simulated is None:
        return None
    gain, offsets = solved(task, simulated, masks)
    pairs = zip(simulated, task.experiments, offsets, strict=True)
    residuals = tuple(x.measured_um - gain * y - offset for y, x, offset in pairs)
    return FirstFit(structure, tuple(values), gain, offsets, residuals)


def fitted(
    task: FitTask,
    structure: Structure,
    start: Sequence[float],
    masks: Sequence[Mask],
    most_evaluations: int = MOST_EVALUATIONS,
) -> FirstFit | None:
    """Fit the numbers of a structure from a start; None where it cannot be simulated there, or solved for."""
    from scipy.optimize import least_squares

    first = evaluated(task, structure, start, masks)
    if first is None or not structure.names:
        return first
    scale = math.sqrt(max(first.square(masks), 1e-300) / max(sum(int(m.sum()) for m in masks), 1))

    def residual(point: Array) -> Array:
        found = evaluated(task, structure, from_search(structure, point, task), masks)
        rows = sum(int(m.sum()) for m in masks)
        if found is None:
            return np.full(rows, 1e3)
        return np.concatenate([r[m] for r, m in zip(found.residuals, masks, strict=True)]) / scale

    point = to_search(structure, start, task)
    steps = SLOPE_STEP / np.maximum(1.0, np.abs(point))
    try:
        found = least_squares(residual, point, max_nfev=most_evaluations, diff_step=steps, x_scale=1.0)
    except np.linalg.LinAlgError:
        return None
    return evaluated(task, structure, from_search(structure, found.x, task), masks)


def with_deviations(task: FitTask, fit: FirstFit, masks: Sequence[Mask]) -> FirstFit:
    """Return a fit with the standard deviations of its numbers and of its gain.

    The covariance is that of least squares, with as many independent readings as the residual's correlation leaves.
    """
    names = fit.structure.names
    point = to_search(fit.structure, fit.values, task)
    base = task.simulated(fit.structure, fit.values)
    if base is None:
        return fit
    columns: list[Array] = []
    slopes: list[float] = []
    for k in range(len(names)):
        step = np.zeros_like(point)
        step[k] = SLOPE_STEP
        high_values = from_search(fit.structure, point + step, task)
        high = task.simulated(fit.structure, high_values)
        if high is None:
            return fit
        change = [fit.gain * (b - a) / SLOPE_STEP for a, b in zip(base, high, strict=True)]
        columns.append(np.concatenate([c[m] for c, m in zip(change, masks, strict=True)]))
        slopes.append((high_values[k] - fit.values[k]) / SLOPE_STEP)
    columns.append(np.concatenate([y[m] for y, m in zip(base, masks, strict=True)]))
    for k in range(len(masks)):
        columns.append(np.concatenate([np.full(int(m.sum()), float(j == k)) for j, m in enumerate(masks)]))
    jacobian = np.column_stack(columns)
    left = np.concatenate([r[m] for r, m in zip(fit.residuals, masks, strict=True)])
    free = max(left.size - jacobian.shape[1], 1)
    variance = float(left @ left) / free * correlation_rows(left)
    norms = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian / np.where(norms > 0.0, norms, 1.0)
    covariance = variance * np.linalg.pinv(scaled.T @ scaled)
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0)) / np.where(norms > 0.0, norms, np.nan)
    values_std = [abs(s) * float(x) for s, x in zip(slopes, std, strict=False)]
    told = tuple(x if math.isfinite(x) else math.inf for x in (*values_std, float(std[len(names)])))
    return FirstFit(fit.structure, fit.values, fit.gain, fit.offsets, fit.residuals, told)
