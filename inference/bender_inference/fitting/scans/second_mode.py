"""The frequency of a second mode, scanned by rings that are held against the residual."""

import math
from dataclasses import replace

import numpy as np
from scipy.linalg.lapack import dtbtrs  # pyright: ignore[reportAttributeAccessIssue]

from bender_compiled.simulation import Simulator
from bender_effects.form import Form
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import training_residual
from bender_inference.fitting.scans.misfit import deepest_valleys
from bender_inference.fitting.standing import Standing
from bender_inference.records.observations import Array
from bender_plant.blocks import BLOCKS
from bender_plant.model import Model, ModelError

RINGING_DAMPING, RINGING_APART, RINGINGS = 0.01, 0.01, 3
"""Of a second mode: the damping ratio with which it is sought, how far apart the logarithms of its frequency are, so
that none lies between two, and how many frequencies are tried."""
EVEN = 0.01
"""Of a row: how much the times of rows that count as even may differ, stamps rounded to microseconds among them."""
FAINT_COLUMN = 1e-30


def ringing_where_it_promises(problem: FitProblem, base: Hypothesis, form: Form, beside: Standing | None) -> Form:
    """Return the form of a second mode with frequencies to set out from where a ringing takes most off the residual.

    A mode of damping ratio zeta shows within zeta times its frequency of the right one, and nothing leads there from
    outside: starts that are further apart miss it where the readings ring with anything else.
    """
    frequency = form.free[1]
    showing = [k for k, x in enumerate(problem.observations) if _even_row_s(x.time_s) * frequency.low < 0.5]
    if not showing:
        return form
    longest = max(showing, key=lambda k: problem.observations[k].measured_um.size)
    x = problem.observations[longest]
    row_s = _even_row_s(x.time_s)
    high_Hz = min(frequency.high, 0.5 / row_s)
    followed = _without_modes(base.model(problem.base, longest), problem.rough[longest])
    residual = training_residual(problem, base, roughly=True)
    plain = problem.readings(base, roughly=True)
    if followed is None or residual is None or plain is None:
        return form
    frequencies = np.exp(np.arange(math.log(frequency.low), math.log(high_Hz), RINGING_APART))
    driven = np.append(followed[1:], followed[-1]) - followed[0]
    first = sum(int(y.training.sum()) for y in problem.observations[:longest])
    rows = slice(first, first + int(x.training.sum()))

    def freed(column: Array) -> Array:
        everywhere = np.zeros(residual.size)
        everywhere[rows] = column[x.training] - column[x.training].mean()
        return everywhere if beside is None else beside.without_it(everywhere)

    left = residual if beside is None else beside.without_it(residual)
    own = freed(plain[longest])
    own /= max(float(np.linalg.norm(own)), FAINT_COLUMN)
    taken = np.empty(frequencies.size)
    for k, each in enumerate(frequencies):
        ringing = freed(_rung(driven, float(each) * row_s, RINGING_DAMPING))
        ringing -= (own @ ringing) * own
        taken[k] = (left @ ringing) ** 2 / max(float(ringing @ ringing), FAINT_COLUMN)
    promising = [float(frequencies[k]) for k in deepest_valleys(-taken, RINGINGS) if taken[k] > 0.0]
    more = replace(frequency, starts=(*frequency.starts, *promising))
    return replace(form, free=(form.free[0], more, *form.free[2:]))


def _even_row_s(time_s: Array) -> float:
    """Return the time from row to row, infinity where rows are not even."""
    steps = np.diff(time_s)
    if steps.size == 0 or float(np.ptp(steps)) > EVEN * float(np.median(steps)):
        return math.inf
    return float(np.median(steps))


def _without_modes(model: Model, simulator: Simulator) -> Array | None:
    """Return the readings (n,) of a model whose structure follows at once."""
    still = tuple(x for x in model.blocks if x.id != "bending_modes" and BLOCKS[x.id].modify is None)
    try:
        return simulator.run(replace(model, blocks=still)).reading_um
    except (ModelError, ArithmeticError):
        return None


def _rung(driven: Array, turns_per_row: float, damping_ratio: float) -> Array:
    """Return how a mode (n,) follows a drive that is held from each row to the next, at rest before the first."""
    decay = math.exp(-damping_ratio * math.tau * turns_per_row)
    root = math.sqrt(1.0 - damping_ratio**2)
    c, s = math.cos(root * math.tau * turns_per_row), math.sin(root * math.tau * turns_per_row) * damping_ratio / root
    pushed = np.zeros(driven.size)
    pushed[1:] = (1.0 - decay * (c + s)) * driven[:-1]
    pushed[2:] += decay * (decay - c + s) * driven[:-2]
    # the recursion as a triangular system: scipy's filters are slow to import
    recursion = np.tile([[1.0], [-2.0 * decay * c], [decay**2]], driven.size)
    found, _ = dtbtrs(recursion, pushed, uplo="L", diag="U")
    return np.asarray(found, dtype=np.float64)
