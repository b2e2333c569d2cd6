"""Steps of the supply, scanned by what rounding to them takes off the residual."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from bender_compiled.simulation import Drive, Simulator
from bender_effects.form import Form
from bender_inference.fitting.criterion import CONFIDENCE
from bender_inference.fitting.fit_problem import ROUGH, FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import training_residual
from bender_inference.fitting.scans.jumps import minimise_in_jumps
from bender_inference.fitting.scans.misfit import deepest_valleys, square_beside
from bender_inference.fitting.standing import Standing
from bender_inference.fitting.starts import Start
from bender_inference.records.observations import Array, Mask, Observations
from bender_plant.model import Model, ModelError

MOST_COMMANDS, TOGETHER = 2000, 16
"""Commands that a scan of steps of the supply compares, and steps for which it does so at once."""
CLOSELY, SIMULATED, MOST_LEVELS = 100, 3, 400
"""Steps of the supply that are looked at closely; of nine around each of the best, those that are simulated; and the
finest that is sought, in parts of the highest voltage."""
MOST_RESPONSE = 4096
SMALL_STEP, STOOD_S = 0.01, 100.0
"""Of a step response: the step, in parts of the range of voltages, and the time that the plant has stood before."""


def scan_supply_steps(
    problem: FitProblem, base: Hypothesis, form: Form, noise_um: float, keep: int, beside: Standing | None = None
) -> list[Start]:
    """Scan the step of the supply evenly in 1 / step: what the plant makes of rounding should show in the residual.

    It is sought through the plant's step response, and as if the readings followed at once: rows that are too far apart
    or too uneven for the ringing show it at any phase.
    """
    if form.free[0].starts:
        return _witnessed_steps(problem, base, form, beside)
    residual = training_residual(problem, base)
    if residual is None:
        return []
    if beside is not None:
        residual = beside.without_it(residual)[: residual.size]
    span = max(float(np.max(np.abs(x.acting_V[x.training]), initial=0.0)) for x in problem.observations)
    if span == 0.0:
        return []
    through, at_once = (_seen_through(problem, base, residual, passed_on=x) for x in (True, False))
    finest = max(_finest_V(through, noise_um), form.free[0].low, span / MOST_LEVELS)
    inverse = np.arange(1.0 / span, 1.0 / finest, 0.05 / span)
    closely = [float(inverse[k]) for k in deepest_valleys(_rounding(through, inverse), CLOSELY)]
    promised = [(x, through) for x in sorted(closely, key=partial(_without_rounding, through))[: 2 * keep]]
    promised += [(float(inverse[k]), at_once) for k in deepest_valleys(_rounding(at_once, inverse), 2 * keep)]
    found: list[Start] = []
    for near, seen in promised:
        around = [float(x) for x in np.linspace(near - 0.04 / span, near + 0.04 / span, 9)]
        for per_volt in sorted(around, key=partial(_without_rounding, seen))[:SIMULATED]:
            tried = training_residual(problem, base.plus(form, (1.0 / per_volt,)), roughly=True)
            if tried is not None:
                found.append(Start((1.0 / per_volt,), square_beside(tried, beside)))
    found = sorted(found, key=lambda start: start.square)[:keep]
    return [_polished(problem, base, form, found[0], beside), *found[1:]] if found else found


def _without_rounding(seen: "Sequence[_SeenThrough]", per_volt: float) -> float:
    return sum(x.without_rounding(1.0 / per_volt) for x in seen)


def _finest_V(seen: "Sequence[_SeenThrough]", noise_um: float) -> float:
    """Return the finest step that shows: its rounding takes more off the residual than the luckiest of many steps.

    Rounding to a step s leaves s^2 / 12 at every row, times the square of the plant's gain. The luckiest of m steps
    takes 2 ln(m / a) times the square of the noise off noise alone, with a chance of a (`criterion`).
    """
    rows = sum(int(x.training.sum()) for x in seen)
    gain = max(abs(float(x.response_um_per_V[-1])) for x in seen)
    luckiest = 2.0 * math.log(20.0 * MOST_LEVELS / (1.0 - CONFIDENCE))
    return noise_um / gain * math.sqrt(12.0 * luckiest / rows) if gain > 0.0 else 0.0


def _rounding(seen: "Sequence[_SeenThrough]", inverse: Array) -> Array:
    """Return minus the square that rounding to each step takes off the residual, in whatever size it shows."""
    commands, weights, rows = _weighed(seen)
    parts = np.array_split(inverse, max(1, math.ceil(inverse.size / TOGETHER)))
    squares = [_rounding_at_once(commands, weights, rows, part) for part in parts]
    return np.concatenate(squares)


def _rounding_at_once(commands: Array, weights: Array, rows: Array, inverse: Array) -> Array:
    error = inverse[:, None] * commands
    np.rint(error, out=error)
    error /= inverse[:, None]
    error -= commands
    shown = np.maximum(error @ weights, 0.0) ** 2
    mean = error @ rows
    np.square(error, out=error)
    power = error @ rows - mean**2 / float(rows.sum())
    return np.divide(-shown, power, out=np.zeros(inverse.size), where=power > 1e-12)


@dataclass(frozen=True, slots=True, eq=False)
class _SeenThrough:
    """A record and what its readings show of small changes of the commands, which the plant passes on linearly.

    Attributes:
        voltage_V: (n,) that acted while each row was read.
        left_um: (n,) residual, 0 where a row is not fitted.
        training: (n,) rows that are.
        response_um_per_V: (m,) what a step makes of the readings at the rows from its own on.
        spectrum: of the response, as long as what it makes of the record.
    """

    voltage_V: Array
    left_um: Array
    training: Mask
    response_um_per_V: Array
    spectrum: NDArray[np.complex128] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "spectrum", np.fft.rfft(self.response_um_per_V, self._length))

    @property
    def _length(self) -> int:
        return cast("int", next_fast_len(self.left_um.size + self.response_um_per_V.size, real=True))

    def _passed_on(self, steps_V: Array) -> Array:
        """Return sum_j steps[k - j] response[j] for every row k."""
        product = np.fft.rfft(steps_V, self._length) * self.spectrum
        return np.asarray(np.fft.irfft(product, self._length)[: steps_V.size], dtype=np.float64)

    def weights(self) -> Array:
        """Return the product of the residual with what 1 V more at every row makes of the readings, (n,).

        A command that changes by e_k at row k moves row k + j by e_k s_j: the sum over the rows is one of e_k times the
        residual seen through s.
        """
        through = self._passed_on(self.left_um[::-1])[::-1]
        return through - np.append(through[1:], 0.0)

    def without_rounding(self, step_V: float) -> float:
        """Return the sum of squares that is left of the residual without what rounding to a step makes."""
        error = step_V * np.round(self.voltage_V / step_V) - self.voltage_V
        moved = self._passed_on(np.diff(error, prepend=0.0))
        left = (self.left_um - moved)[self.training]
        return float(np.sum((left - left.mean()) ** 2))


def _seen_through(problem: FitProblem, base: Hypothesis, residual: Array, *, passed_on: bool) -> list[_SeenThrough]:
    """Return every record, seen through the plant's step response, or as if its readings followed at once."""
    readings = problem.readings(base)
    gain = 1.0 if readings is None else problem.calibrate(readings).gain
    found, first = [], 0
    for record, x in enumerate(problem.observations):
        left, count = np.zeros(x.measured_um.size), int(x.training.sum())
        left[x.training] = residual[first : first + count]
        first += count
        response = np.ones(left.size)
        if passed_on:
            response = gain * _step_response(base.model(problem.base, record), x)
        found.append(_SeenThrough(x.acting_V, left, x.training, response))
    return found


def _weighed(seen: Sequence[_SeenThrough]) -> tuple[Array, Array, Array]:
    """Return the commands that matter most (m,), their weights and for how many rows each of them is."""
    commands, which = np.unique(np.concatenate([x.voltage_V for x in seen]), return_inverse=True)
    product, rows = np.zeros(commands.size), np.zeros(commands.size)
    np.add.at(product, which, np.concatenate([x.weights() for x in seen]))
    np.add.at(rows, which, 1.0)
    most = np.argsort(-np.abs(product))[:MOST_COMMANDS]
    return commands[most], product[most], rows[most]


def _step_response(model: Model, x: Observations) -> Array:
    """Return what a small step from the middle of the voltages makes of the readings at the rows after it, per volt."""
    volts = x.command_V
    middle, step = 0.5 * float(np.max(volts) + np.min(volts)), SMALL_STEP * float(np.ptp(volts))
    row_s = float(np.median(np.diff(x.time_s)))
    times = np.linspace(row_s, row_s * MOST_RESPONSE, MOST_RESPONSE)[: volts.size]
    commanded = np.array([-STOOD_S, 0.0])
    try:
        still, stepped = (
            Simulator(Drive(times, commanded, np.array([middle, middle + y])), coarser=ROUGH).run(model).reading_um
            for y in (0.0, step)
        )
    except (ModelError, ArithmeticError):
        return np.zeros(times.size)
    return (stepped - still) / step if step > 0.0 else stepped - still


def _witnessed_steps(problem: FitProblem, base: Hypothesis, form: Form, beside: Standing | None) -> list[Start]:
    """Return the steps that a witness tells, without a scan."""
    found = []
    for value in form.free[0].starts:
        tried = training_residual(problem, base.plus(form, (value,)), roughly=True)
        if tried is not None:
            found.append(_polished(problem, base, form, Start((value,), square_beside(tried, beside)), beside))
    return found


def _polished(problem: FitProblem, base: Hypothesis, form: Form, start: Start, beside: Standing | None) -> Start:
    """Return a start with a finer step."""

    def square_at(value: float) -> float:
        tried = training_residual(problem, base.plus(form, (value,)), roughly=True)
        return math.inf if tried is None else square_beside(tried, beside)

    value, square = minimise_in_jumps(start.values[0], start.square, square_at)
    return Start((value,), square)
