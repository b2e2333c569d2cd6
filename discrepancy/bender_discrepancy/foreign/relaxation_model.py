"""A stand-in whose relaxation bends, for an FMU that is not linear.

The linear transducer of a first model is replaced by the equation that the paper learned, (30), with coefficients of
its own: w' = a w + b u + c u' + d |w| + e w |w|. They are fitted by the error of the simulated readings to all runs of
the FMU at once, together with the modes, lags and delay that the quickest run shows. A start comes from the equation in
its integral form, which is linear in the coefficients (Messenger and Bortz 2021, Weak SINDy,
doi:10.1137/20M1343166).
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bender_compiled.simulation import Simulator
from bender_inference.fitting.own_numbers import own_form
from bender_inference.records.observations import observe
from bender_loop.records.drive import InputHold
from bender_loop.records.record import Record
from bender_plant.blocks import bending_modes, calibration, learned_hysteresis, plant_lag, second_mode, transport_delay
from bender_plant.model import BlockSettings, Model
from bender_plant.parameter import ModelError

Array = NDArray[np.float64]
Run = tuple[Record, Array]
"""Levels of chance, and what the FMU shows under them."""

WINDOWS_ROWS = (10, 40, 160)
"""Over which the equation is integrated for a start: what rings averages out, what relaxes shows."""
STARTS = 2
"""Of those, fitted."""
MOST_EVALUATIONS = 40
CLEARLY_LESS = 0.7
"""Of the rms: further linear parts have to leave less than that."""
LARGEST = 1e100
"""Integrals beyond it are of an FMU that runs away."""
FAR_OFF = 1e3
"""Of the spread; a model that all but runs away is as far off as one that does."""
FOLLOWED = 1e-4
"""Of the spread; a model that leaves less than that is looked no further from."""
DYNAMICS = (transport_delay.ID, plant_lag.ID, bending_modes.ID, second_mode.ID)


@dataclass(frozen=True, slots=True)
class _Task:
    """Runs of the FMU, ready to be simulated."""

    runs: Sequence[Run]
    simulators: Sequence[Simulator]
    scales: Sequence[float]
    rest: float

    def residual(self, model: Model) -> Array:
        """Return what a model leaves of every run, in parts of its spread.

        Raises:
            ArithmeticError: the model runs away.
        """
        rows = zip(self.runs, self.simulators, self.scales, strict=True)
        return np.concatenate([(y - x.run(model).reading_um) / scale for (_, y), x, scale in rows])


def fit_relaxation(runs: Sequence[Run], blocks: Sequence[BlockSettings], hold: InputHold) -> Model | None:
    """Return the stand-in that leaves least of the runs of an FMU; None where the equation follows none of them.

    Args:
        runs: of the FMU from rest at 0 V, at several rates.
        blocks: of a linear model that follows the quickest of them.
        hold: the voltage between two rows.
    """
    simulators = [Simulator(observe(x, hold != "hold", False, hold == "smooth").drive) for x, _ in runs]
    scales = [max(float(np.std(y)), 1e-300) for _, y in runs]
    task = _Task(runs, simulators, scales, float(runs[0][1][0]))
    starts = [x for record, y in runs for x in _starts(record, y - task.rest)]
    best: tuple[float, Model] | None = None
    for kept in _subsets([x for x in blocks if x.id in DYNAMICS]):
        found = _fitted(task, starts, kept)
        if found is not None and (best is None or found[0] < CLEARLY_LESS * best[0]):
            best = found
        if best is not None and best[0] < FOLLOWED:
            break
    return None if best is None else best[1]


def _subsets(dynamics: Sequence[BlockSettings]) -> list[tuple[BlockSettings, ...]]:
    """Return sets of linear parts, the smaller ones first; a further mode needs a first one."""
    sets = [x for count in range(len(dynamics) + 1) for x in itertools.combinations(dynamics, count)]
    return [x for x in sets if second_mode.ID not in (ids := {y.id for y in x}) or bending_modes.ID in ids]


def _starts(record: Record, shown: Array) -> list[Array]:
    """Return coefficients (5,) by linear regression of the integrated equation, for each window."""
    voltage_V, step_s = record.voltage_V, float(np.median(np.diff(record.time_s)))
    middle = 0.5 * (shown[1:] + shown[:-1])
    found = []
    for rows in WINDOWS_ROWS:

        def integral(x: Array, rows: int = rows) -> Array:
            sums = np.concatenate([[0.0], np.cumsum(x)]) * step_s
            return sums[rows:] - sums[:-rows]

        across = integral(middle)
        with np.errstate(over="ignore"):
            further = [integral(x) for x in (voltage_V[:-1], np.abs(middle), middle * np.abs(middle))]
        jumps = (voltage_V[rows:] - voltage_V[:-rows])[: across.size]
        terms = np.column_stack([across, further[0], jumps, further[1], further[2]])
        if terms.shape[0] < terms.shape[1] or not np.all(np.abs(terms) < LARGEST):
            continue
        sizes = np.maximum(np.sqrt(np.mean(terms**2, axis=0)), 1e-300)
        change = (shown[rows:] - shown[:-rows])[: across.size]
        found.append(np.linalg.lstsq(terms / sizes, change, rcond=None)[0] / sizes)
    return found


def _model(coefficients: Array, kept: Sequence[BlockSettings], rest: float) -> Model:
    """Return the equation with linear parts behind it.

    Raises:
        ModelError: a number is out of the bounds of its block.
    """
    a, b, c, d, e = (float(x) for x in coefficients)
    equation = learned_hysteresis.Parameters(min(a, 0.0), b, c, d, min(e, 0.0))
    scale = calibration.Parameters(offset_um=rest)
    blocks = (BlockSettings(learned_hysteresis.ID, equation), *kept, BlockSettings(calibration.ID, scale))
    return Model("relaxation", None, blocks, "A relaxation that bends, fitted to an FMU")


def _fitted(task: _Task, starts: Sequence[Array], kept: Sequence[BlockSettings]) -> tuple[float, Model] | None:
    """Return the rms that is left, in parts of the spread, and the model."""

    def rms(coefficients: Array) -> float:
        try:
            return float(np.sqrt(np.mean(task.residual(_model(coefficients, kept, task.rest)) ** 2)))
        except (ModelError, ArithmeticError):
            return math.inf

    ranked = sorted(((rms(x), k) for k, x in enumerate(starts)))[:STARTS]
    found = [_nearest(task, starts[k], kept) for left, k in ranked if math.isfinite(left)]
    return min((x for x in found if x is not None), key=lambda x: x[0], default=None)


def _nearest(task: _Task, start: Array, kept: Sequence[BlockSettings]) -> tuple[float, Model] | None:
    base = _model(start, kept, task.rest)
    own = own_form(base)
    given = np.array([x.inward(x.starts[0]) for x in own.free]) if own else np.zeros(0)
    sizes = np.where(start != 0.0, np.abs(start), 1.0)
    count = sum(y.size for _, y in task.runs)

    def model(x: Array) -> Model:
        equation = _model(x[:5] * sizes, kept, task.rest)
        if own is None:
            return equation
        return own.apply(equation, tuple(f.outward(float(p)) for f, p in zip(own.free, x[5:], strict=True)))

    def residual(x: Array) -> Array:
        try:
            return np.clip(task.residual(model(x)), -FAR_OFF, FAR_OFF)
        except (ModelError, ArithmeticError):
            return np.full(count, FAR_OFF)

    solved = least_squares(
        residual, np.concatenate([start / sizes, given]), x_scale="jac", max_nfev=MOST_EVALUATIONS, diff_step=1e-6
    )
    left = math.sqrt(2.0 * float(solved.cost) / count)
    try:
        return left, _settled(model(solved.x))
    except ModelError:
        return None


def _settled(model: Model) -> Model:
    """Return the model with the frequency where its factor moved it."""
    modes = next((x.parameters for x in model.blocks if x.id == bending_modes.ID), None)
    if not isinstance(modes, bending_modes.Parameters) or modes.first_frequency_Hz is None:
        return model
    moved = asdict(modes) | {"first_frequency_Hz": modes.first_frequency_Hz * modes.frequency_factor}
    return model.with_block(bending_modes.ID, **(moved | {"frequency_factor": 1.0}))
