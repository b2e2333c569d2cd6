"""The Bouc-Wen model, in its corrected form, by the error of the simulated readings.

    w = d u + h,      h' = alpha u' - beta |u'| h - gamma u' |h|

h is proportional to alpha, so d, alpha and the offset are solved for inside each evaluation and only the two numbers
beta > 0 and rho = gamma / beta in [-1, 1] are searched: on a grid first, then from its best points.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_identify.fitting.candidate import Candidate, described, with_offset
from bender_identify.fitting.output_error import fit_output
from bender_identify.fitting.resimulation import Bank, search_bank, with_transducer
from bender_identify.records.experiment import Experiment
from bender_plant.model import Model

Array = NDArray[np.float64]

BETAS = tuple(np.geomspace(0.1, 30.0, 9).tolist())
"""Tried values of beta, in units of one over half the span of the voltage."""
RANGE = (1e-3, 1e3)
RHOS = (-0.9, -0.5, 0.0, 0.5, 0.9)
STARTS = 2
NAMES = ("d", "alpha", "beta", "gamma")
UNITS = ("um/V", "um/V", "1/V", "1/V")


@dataclass(frozen=True, slots=True)
class _Linear:
    gain: float
    alpha: float
    rss: float


def fit_bouc_wen(experiments: Sequence[Experiment], base: Model, start: Array | None = None) -> Candidate:
    """Fit the model to the fitted rows.

    Args:
        experiments: records made ready.
        base: gives everything but the material.
        start: (d, alpha, beta, gamma) to start from; None searches.
    """
    if start is None:
        start = _searched(search_bank(experiments, base), base)
    half_V = 0.5 * max(float(np.ptp(x.acting_V)) for x in experiments)
    span_um = max(float(np.nanstd(x.measured_um)) for x in experiments)
    scale = np.array([span_um / half_V, span_um / half_V, 1.0 / half_V, 1.0 / half_V])
    fit = fit_output(Bank(experiments), lambda x: _model(base, x), start, scale, 8)
    values = [float(x) for x in fit.values]
    return Candidate(
        id="bouc_wen",
        title="Bouc-Wen, corrected",
        equation="w = {:.4g} u + h, h' = {:.4g} u' - {:.4g} |u'| h - {:.4g} u' |h|".format(*values).replace(
            "- -", "+ "
        ),
        model=with_offset(_model(base, fit.values), fit.offset_um),
        coefficients=described(NAMES, UNITS, fit),
        parameters=len(NAMES) + 1,
        fit=fit,
        refit=lambda others: fit_bouc_wen(others, base, fit.values),
    )


def _model(base: Model, values: Array) -> Model:
    d, alpha, beta, gamma = (float(x) for x in values)
    return with_transducer(
        base, "bouc_wen", linear_gain_um_per_V=d, alpha_um_per_V=alpha, beta_1_per_V=beta, gamma_1_per_V=gamma
    )


def _searched(bank: Bank, base: Model) -> Array:
    from scipy.optimize import minimize

    half_V = 0.5 * max(float(np.ptp(x.acting_V)) for x in bank.experiments)
    search = _Search(bank, base)
    grid = [(search.solved(beta / half_V, rho).rss, beta / half_V, rho) for beta in BETAS for rho in RHOS]
    best: tuple[float, float, float] = min(grid)
    for _, beta, rho in sorted(grid)[:STARTS]:
        found = minimize(
            lambda x: math.log(search.solved(*_pair(x, half_V)).rss + 1e-300),
            np.array([math.log(beta), math.atanh(rho)]),
            method="Nelder-Mead",
            options={"xatol": 1e-3, "fatol": 1e-5, "maxfev": 80},
        )
        beta, rho = _pair(found.x, half_V)
        best = min(best, (search.solved(beta, rho).rss, beta, rho))
    _, beta, rho = best
    linear = search.solved(beta, rho)
    return np.array([linear.gain, linear.alpha, beta, beta * rho * math.copysign(1.0, linear.alpha)])


def _pair(x: Array, half_V: float) -> tuple[float, float]:
    """Return (beta, rho) of the search's unbounded numbers."""
    low, high = (math.log(part / half_V) for part in RANGE)
    return math.exp(min(max(float(x[0]), low), high)), math.tanh(float(x[1]))


class _Search:
    """Solves for d, alpha and the offset beside a hysteretic part of unit alpha."""

    def __init__(self, bank: Bank, base: Model) -> None:
        self._bank, self._base = bank, base
        self._still = self._run(0.0, 0.0, 1.0, 0.0)
        self._linear = self._run(1.0, 0.0, 1.0, 0.0) - self._still
        self._reading = bank.fitted(bank.measured()) - self._still

    def _run(self, *values: float) -> Array:
        return self._bank.fitted(self._bank.run(_model(self._base, np.array(values))))

    def solved(self, beta: float, rho: float) -> _Linear:
        hysteretic = self._run(0.0, 1.0, beta, beta * rho) - self._still
        columns = np.column_stack([self._linear, hysteretic, np.ones(len(self._reading))])
        size = np.linalg.norm(columns, axis=0)
        size[size == 0.0] = 1.0
        solution = np.linalg.lstsq(columns / size, self._reading, rcond=1e-10)[0] / size
        error = self._reading - columns @ solution
        return _Linear(float(solution[0]), float(solution[1]), float(error @ error))
