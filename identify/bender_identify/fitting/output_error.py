"""Parameters by the error of the simulated output: least squares over whole records.

Unlike a regression on derivatives it is unbiased under noise of the reading (Ljung, System Identification, 2nd ed.
1999, section 10.2), and its Jacobian says how well each parameter is known.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_identify.fitting.correlation import correlation_rows
from bender_identify.fitting.repeating import repeating_factor
from bender_identify.fitting.resimulation import Bank
from bender_plant.model import Model

Array = NDArray[np.float64]
Build = Callable[[Array], Model]

DIFFERENCE = 1e-5
"""Step of the numerical derivatives, relative to the scale of each parameter."""
AWAY = 1e3
"""A simulation that ran away counts as this many times the readings."""


@dataclass(frozen=True, slots=True, eq=False)
class OutputFit:
    """A fit of p parameters and an offset to n readings.

    Attributes:
        values: (p,) parameters.
        offset_um: constant added to the simulation.
        covariance: (p + 1, p + 1), of the parameters and the offset; widened where the residual is correlated, zero
            for an offset that was not fitted.
        jacobian: (n, p), of the readings to the parameters.
        residual_um: (n,) measured minus simulated.
        output_um: (n,) simulated, the offset included.
        correlation_rows: rows that count as one reading.
        repeating_factor: by which the variances grow because part of the residual comes back in every cycle.
    """

    values: Array
    offset_um: float
    covariance: Array
    jacobian: Array
    residual_um: Array
    output_um: Array
    correlation_rows: float
    repeating_factor: float = 1.0


def simulated(bank: Bank, model: Model) -> Array:
    """Return the fitted rows of a simulation; far away where the model ran away."""
    measured = bank.fitted(bank.measured())
    try:
        readings = bank.fitted(bank.run(model))
    except ArithmeticError:
        return measured + AWAY * (1.0 + np.abs(measured))
    far = AWAY * (1.0 + float(np.abs(measured).max()))
    return np.clip(readings, -far, far)


def fit_output(
    bank: Bank,
    build: Build,
    start: Array,
    scale: Array,
    most_evaluations: int = 40,
    rough: bool = False,
    free_offset: bool = True,
) -> OutputFit:
    """Fit parameters to the fitted rows of the experiments, the offset solved for inside each evaluation.

    Args:
        bank: the experiments; its `quick` decides what is simulated.
        build: model from parameters; may raise ValueError for parameters that cannot be.
        start: (p,) first guess.
        scale: (p,) size of a change that matters.
        most_evaluations: limit of the solver's evaluations, Jacobians apart.
        rough: stop early and take one-sided derivatives on the way; enough to compare structures.
        free_offset: fit a constant too; without, the reading at rest is that of the base model.

    Raises:
        ValueError: no model can be built of the first guess.
    """
    from scipy.optimize import least_squares

    measured = bank.fitted(bank.measured())

    def residual(x: Array) -> Array:
        try:
            error = measured - simulated(bank, build(x * scale))
        except ValueError:
            return AWAY * (1.0 + np.abs(measured))
        return error - error.mean() if free_offset else error

    def slopes(x: Array) -> Array:
        columns = jacobian(bank, build, x * scale, scale, one_sided=rough)
        return -(_centred(columns) if free_offset else columns) * scale

    small = 1e-6 if rough else 1e-10
    solution = least_squares(
        residual, start / scale, jac=slopes,  # pyright: ignore[reportArgumentType]
        method="trf", x_scale="jac", max_nfev=most_evaluations,
        xtol=max(small, 1e-12), ftol=small, gtol=1e-15,
    )  # fmt: skip
    return judged(bank, build, np.asarray(solution.x) * scale, scale, free_offset)


def judged(bank: Bank, build: Build, values: Array, scale: Array, free_offset: bool = True) -> OutputFit:
    """Return parameters found elsewhere with their offset, Jacobian and covariance."""
    measured = bank.fitted(bank.measured())
    error = measured - simulated(bank, build(values))
    offset = float(error.mean()) if free_offset else 0.0
    residual = error - offset
    slopes = jacobian(bank, build, values, scale)
    rows = correlation_rows(residual)
    covariance = _covariance(slopes, residual, rows, free_offset)
    factor = repeating_factor(bank.experiments, residual, rows)
    return OutputFit(values, offset, covariance, slopes, residual, measured - residual, rows, factor)


def jacobian(bank: Bank, build: Build, values: Array, scale: Array, one_sided: bool = False) -> Array:
    """Return the derivatives (n, p) of the fitted rows to the parameters, by central or one-sided differences."""
    here = simulated(bank, build(values))
    columns = []
    for k in range(len(values)):
        step = np.zeros_like(values)
        step[k] = DIFFERENCE * scale[k]
        above = _moved(bank, build, values + step)
        below = None if one_sided and above is not None else _moved(bank, build, values - step)
        # one-sided at the edge of what can be, too
        high, low = here if above is None else above, here if below is None else below
        columns.append((high - low) / ((above is not None) + (below is not None)) / step[k])
    return np.column_stack(columns) if columns else np.zeros((len(here), 0))


def _moved(bank: Bank, build: Build, values: Array) -> Array | None:
    try:
        model = build(values)
    except ValueError:
        return None
    return simulated(bank, model)


def _centred(columns: Array) -> Array:
    return columns - columns.mean(axis=0)


def _covariance(slopes: Array, residual: Array, rows: float, free_offset: bool) -> Array:
    full = np.column_stack([slopes, np.full(len(residual), float(free_offset))])
    size = np.linalg.norm(full, axis=0)
    size[size == 0.0] = 1.0
    variance = rows * float(residual @ residual) / max(len(residual) - full.shape[1], 1)
    inverse = np.linalg.pinv((full / size).T @ (full / size), rcond=1e-14, hermitian=True)
    return variance * inverse / np.outer(size, size)


def information(rss: float, count: int, parameters: int, rows: float, floor: float) -> float:
    """Return the Bayesian information criterion for readings of which `rows` count as one.

    `floor` is the rms below which a difference means nothing (rounding of the simulation).
    """
    independent = count / rows
    return independent * float(np.log(rss / count + floor * floor)) + parameters * float(np.log(max(independent, 2.0)))
