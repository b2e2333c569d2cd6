"""Scans of the effects whose misfit has many narrow valleys: delay, steps of the supply, hum, a second mode."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.interpolate import Akima1DInterpolator
from scipy.signal import lfilter

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.effects.form import Form
from bender_discrepancy.fitting.criterion import CONFIDENCE
from bender_discrepancy.fitting.fit_problem import ROUGH, FitProblem
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.journal import current_journal
from bender_discrepancy.fitting.output_error import training_residual
from bender_discrepancy.fitting.standing import Standing
from bender_discrepancy.fitting.starts import Start, scan, solved
from bender_discrepancy.records.excitation import one_sine, sine_frequency_Hz
from bender_discrepancy.records.observations import Array, Mask, Observations
from bender_discrepancy.records.spectrum import bin_s, spectrum, swing_columns
from bender_plant.blocks import BLOCKS
from bender_plant.model import Model, ModelError

# fine beside a quarter of the ringing period of the actuator (2.4 ms) and of a vibrometer's row
DELAY_STEP_S = 5e-4
VALLEYS, NEAR = 12, 25
"""Of a delay, that are scanned closely, and in how many steps."""
MOST_COMMANDS, TOGETHER = 2000, 16
"""Commands that a scan of steps of the supply compares, and steps for which it does so at once."""
CLOSELY, SIMULATED, MOST_LEVELS = 100, 3, 400
"""Steps of the supply that are looked at closely; of nine around each of the best, those that are simulated; and the
finest that is sought, in parts of the highest voltage."""
MOST_RESPONSE = 4096
SMALL_STEP, STOOD_S = 0.01, 100.0
"""Of a step response: the step, in parts of the range of voltages, and the time that the plant has stood before."""
# two lines of a spectrum, in units of one over its record
LINES_APART = 2.0
MOST_DELAYED_ROWS, DELAYS_TOGETHER = 2000, 50
"""Rows that a scan of the delay looks at, and delays that are tried on them at once."""
# parts of a step of the supply by which it is moved, one after the other
POLISHED = (1e-3, 4e-4, 1.6e-4, 6e-5, 2.5e-5, 1e-5, 4e-6)

RINGING_DAMPING, RINGING_APART, RINGINGS = 0.01, 0.01, 3
"""Of a second mode: the damping ratio with which it is sought, how far apart the logarithms of its frequency are, so
that none lies between two, and how many frequencies are tried."""
EVEN = 1e-3
"""Of a row: how much the times of rows that count as even may differ."""
FAINT_COLUMN = 1e-30


def scan_any(
    problem: FitProblem,
    base: Hypothesis,
    form: Form,
    noise_um: float,
    keep: int = 2,
    beside: Standing | None = None,
) -> list[Start]:
    """Return the most promising starts of a form, by the scan that suits it; `beside` as in `scan`."""
    journal = current_journal()
    if journal is None:
        return _scan_any(problem, base, form, noise_um, keep, beside)
    key = journal.key(problem, base, "scan", form, noise_um, keep, beside is not None)
    told = journal.told(key)
    if told is not None:
        return [Start(tuple(values), square) for values, square in told]
    found = _scan_any(problem, base, form, noise_um, keep, beside)
    journal.entries[key] = [[list(x.values), x.square] for x in found]
    return found


def _scan_any(
    problem: FitProblem, base: Hypothesis, form: Form, noise_um: float, keep: int, beside: Standing | None
) -> list[Start]:
    if form.effect == "transport_delay":
        return scan_delay(problem, base, form, keep, beside)
    if form.effect == "supply_quantisation":
        return scan_supply_steps(problem, base, form, noise_um, keep, beside)
    if form.effect == "periodic_disturbance":
        return scan_hum(problem, base, form, keep, beside)
    if form.effect == "second_mode":
        return scan(problem, base, _ringing_where_it_promises(problem, base, form, beside), keep, beside)
    return scan(problem, base, form, keep, beside)


def _square(residual: Array, beside: Standing | None) -> float:
    return float(residual @ residual) if beside is None else beside.square(residual)


def _valleys(squares: Array, keep: int) -> list[int]:
    """Return the indices of the deepest local minima."""
    padded = np.concatenate([[np.inf], squares, [np.inf]])
    local = np.nonzero((squares <= padded[:-2]) & (squares <= padded[2:]))[0]
    return [int(k) for k in local[np.argsort(squares[local])][:keep]]


def _scanned(x: Observations) -> NDArray[np.intp]:
    """Return the training rows that a scan of the delay looks at: all of them, or many spread over the record."""
    rows = np.flatnonzero(x.training)
    if rows.size <= MOST_DELAYED_ROWS:
        return rows
    return rows[np.linspace(0, rows.size - 1, MOST_DELAYED_ROWS).astype(int)]


@dataclass(frozen=True, slots=True, eq=False)
class _Curve:
    """Readings that are simulated at close instants, as far back from every row of a record as a delay may reach.

    Attributes:
        time_s: (m,) the instants, whole steps of a scan.
        reading_um: (m,) at them.
        at: (n,) which of the instants is the first one that is not before a row.
        early: (n,) how long before it the row is, in steps.
    """

    time_s: Array
    reading_um: Array
    at: NDArray[np.intp]
    early: Array

    def steps_before(self, steps: NDArray[np.intp]) -> Array:
        """Return the readings some steps (k,) before every row, (n, k), on straight lines between the instants."""
        places = self.at[:, None] - steps
        later = self.reading_um[np.maximum(places, 0)]
        earlier = self.reading_um[np.maximum(places - 1, 0)]
        return later + self.early[:, None] * (earlier - later)


def _dense(problem: FitProblem, base: Hypothesis, x: Observations, longest_s: float) -> _Curve | None:
    """Return the readings at the instants of the scanned rows and, closely spaced, before them."""
    back = round(longest_s / DELAY_STEP_S) + 1
    rows = x.time_s[_scanned(x)] / DELAY_STEP_S
    steps = np.ceil(rows).astype(np.int64)
    instants = _covered(np.maximum(steps - back, 0), steps)
    times = np.asarray(DELAY_STEP_S * instants, dtype=np.float64)
    drive = replace(x.drive, row_time_s=times)
    try:
        readings = Simulator(drive, coarser=ROUGH).run(base.model(problem.base)).reading_um
    except (ModelError, ArithmeticError):
        return None
    return _Curve(times, readings, np.searchsorted(instants, steps), steps - rows)


def _covered(first: NDArray[np.int64], last: NDArray[np.int64]) -> NDArray[np.intp]:
    """Return the whole numbers, none negative, that lie in any of some ranges, both ends included."""
    begun = np.bincount(first, minlength=int(last.max()) + 2)
    begun[1:] -= np.bincount(last, minlength=begun.size)[: begun.size - 1]
    return np.flatnonzero(np.cumsum(begun))


def scan_delay(
    problem: FitProblem, base: Hypothesis, form: Form, keep: int, beside: Standing | None = None
) -> list[Start]:
    """Scan the delay on one simulation that is read at shifted instants, and then closely where it promises most.

    Of a record whose steps lie on a grid of rows, a delay that is off by a period of the ringing misses little. Between
    such valleys no slope leads from one to the next, and each is so narrow that the steps of the scan do not tell how
    deep it is.
    """
    dense = [_dense(problem, base, x, form.free[0].high / 2.0) for x in problem.observations]
    curves = [x for x in dense if x is not None]
    if len(curves) < len(dense):
        return []
    rows = [_scanned(x) for x in problem.observations]
    times = [x.time_s[k] for k, x in zip(rows, problem.observations, strict=True)]
    goals = [x.measured_um[k] for k, x in zip(rows, problem.observations, strict=True)]
    # as many rows as the other forms are judged on
    share = sum(int(x.training.sum()) for x in problem.observations) / sum(k.size for k in rows)
    beside = None if beside is None else beside.of(_places(problem, rows))

    def freed(parts: Sequence[Array]) -> Array:
        centred = np.concatenate([x - x.mean(axis=0) for x in parts])
        return centred if beside is None else beside.without_it(centred)

    measured = freed(goals)
    square = float(measured @ measured)

    def left(shifted: Sequence[Array]) -> Array:
        y = freed(shifted)
        power = np.sum(y**2, axis=0)
        taken = np.divide((measured @ y) ** 2, power, out=np.zeros(power.size), where=power > 0.0)
        return share * (square - taken)

    steps = np.arange(1, math.ceil(form.free[0].high / 2.0 / DELAY_STEP_S))
    parts = np.array_split(steps, max(1, math.ceil(steps.size / DELAYS_TOGETHER)))
    coarsely = np.concatenate([left([x.steps_before(part) for x in curves]) for part in parts])
    # a delay shorter than a step of the scan lies in the valley at zero
    valleys = DELAY_STEP_S * np.array([0, *steps[_valleys(coarsely, VALLEYS)]])
    closely = [Akima1DInterpolator(x.time_s, x.reading_um, extrapolate=True) for x in curves]
    near = DELAY_STEP_S * np.linspace(-0.6, 0.6, NEAR)
    found = []
    for middle in valleys:
        around = np.maximum(middle + near, 0.0)
        squares = left([read(t[:, None] - around) for t, read in zip(times, closely, strict=True)])
        k = int(np.argmin(squares))
        found.append(Start((float(around[k]),), float(squares[k])))
    return sorted(found, key=lambda x: x.square)[: keep + 1]


def _places(problem: FitProblem, rows: list[NDArray[np.intp]]) -> NDArray[np.intp]:
    """Return where rows of every record stand among the training rows of all of them."""
    found, before = [], 0
    for k, x in zip(rows, problem.observations, strict=True):
        training = np.flatnonzero(x.training)
        found.append(before + np.searchsorted(training, k))
        before += training.size
    return np.concatenate(found)


def scan_supply_steps(
    problem: FitProblem, base: Hypothesis, form: Form, noise_um: float, keep: int, beside: Standing | None = None
) -> list[Start]:
    """Scan the step of the supply evenly in 1 / step: what the plant makes of rounding should show in the residual.

    It is sought through the plant's step response, and as if the readings followed at once: rows that are too far apart
    or too uneven for the ringing show it at any phase.
    """
    if form.free[0].starts:
        return _told_steps(problem, base, form, beside)
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
    closely = [float(inverse[k]) for k in _valleys(_rounding(through, inverse), CLOSELY)]
    promised = [(x, through) for x in sorted(closely, key=partial(_without_rounding, through))[: 2 * keep]]
    promised += [(float(inverse[k]), at_once) for k in _valleys(_rounding(at_once, inverse), 2 * keep)]
    found: list[Start] = []
    for near, seen in promised:
        around = [float(x) for x in np.linspace(near - 0.04 / span, near + 0.04 / span, 9)]
        for per_volt in sorted(around, key=partial(_without_rounding, seen))[:SIMULATED]:
            tried = training_residual(problem, base.plus(form, (1.0 / per_volt,)), roughly=True)
            if tried is not None:
                found.append(Start((1.0 / per_volt,), _square(tried, beside)))
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


def _told_steps(problem: FitProblem, base: Hypothesis, form: Form, beside: Standing | None) -> list[Start]:
    """Return the steps that a witness tells, without a scan."""
    found = []
    for value in form.free[0].starts:
        tried = training_residual(problem, base.plus(form, (value,)), roughly=True)
        if tried is not None:
            found.append(_polished(problem, base, form, Start((value,), _square(tried, beside)), beside))
    return found


def _polished(problem: FitProblem, base: Hypothesis, form: Form, start: Start, beside: Standing | None) -> Start:
    """Return a start with a finer step: a slope does not find it, since the misfit falls in jumps.

    A command flips to the next level where the step is off by its distance to the middle of two, over its level.
    """
    best = start
    for width in POLISHED:
        for share in (-1.0, -0.5, 0.5, 1.0):
            value = start.values[0] * (1.0 + share * width)
            tried = training_residual(problem, base.plus(form, (value,)), roughly=True)
            if tried is not None and _square(tried, beside) < best.square:
                best = Start((value,), _square(tried, beside))
        start = best
    return best


def _ringing_where_it_promises(problem: FitProblem, base: Hypothesis, form: Form, beside: Standing | None) -> Form:
    """Return the form of a second mode with frequencies to set out from where a ringing takes most off the residual.

    A mode of damping ratio zeta shows within zeta times its frequency of the right one, and nothing leads there from
    outside: starts that are further apart miss it where the readings ring with anything else.
    """
    longest = max(range(len(problem.observations)), key=lambda k: problem.observations[k].measured_um.size)
    x = problem.observations[longest]
    row_s = float(np.median(np.diff(x.time_s))) if x.measured_um.size > 2 else 0.0
    frequency = form.free[1]
    high_Hz = min(frequency.high, 0.5 / row_s) if row_s > 0.0 else 0.0
    if high_Hz <= frequency.low or float(np.ptp(np.diff(x.time_s))) > EVEN * row_s:
        return form
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
    promising = frequencies[_valleys(-taken, RINGINGS)]
    more = replace(frequency, starts=(*frequency.starts, *(float(f) for f in promising)))
    return replace(form, free=(form.free[0], more, *form.free[2:]))


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
    numerator = [0.0, 1.0 - decay * (c + s), decay * (decay - c + s)]
    return np.asarray(lfilter(numerator, [1.0, -2.0 * decay * c, decay**2], driven))


def scan_hum(
    problem: FitProblem, base: Hypothesis, form: Form, keep: int, beside: Standing | None = None
) -> list[Start]:
    """Scan the frequency of a disturbance in the spectrum of the residual of the longest record."""
    readings = problem.readings(base)
    if readings is None:
        return []
    residuals = problem.residuals(readings, problem.calibrate(readings))
    rows = [(x.time_s[x.training], r[x.training]) for x, r in zip(problem.observations, residuals, strict=True)]
    longest = max(range(len(rows)), key=lambda k: rows[k][0].size)
    x, (times, residual) = problem.observations[longest], rows[longest]
    frequencies, power = spectrum(times, residual - residual.mean(), bin_s(x.time_s))
    power = np.where(frequencies > 1.5 / float(np.ptp(x.time_s)), power, 0.0)
    power[_of_the_drive(x, frequencies)] = 0.0
    found = []
    for k in _valleys(-power, keep):
        values: list[float] = []
        left: list[Array] = []
        for each in rows[: form.records]:
            weights, rest = _swing(*each, float(frequencies[k]))
            values += [*weights, float(frequencies[k])]
            left.append(rest)
        left += [residual for _, residual in rows[form.records :]]
        found.append(Start(tuple(values), _square(np.concatenate(left), beside)))
    return found


def _swing(times: Array, residual: Array, frequency_Hz: float) -> tuple[tuple[float, float], Array]:
    """Return the sine and the cosine of a frequency in a residual, and what they leave of it."""
    columns = swing_columns(times, frequency_Hz)
    weights, _ = solved(list(columns.T), residual)
    left = residual - columns @ weights
    return (float(weights[0]), float(weights[1])), left


def _of_the_drive(x: Observations, frequencies: Array) -> NDArray[np.bool_]:
    """Return which frequencies are those of a drive by one sine, whose overtones are no disturbance."""
    if not one_sine(x.time_s, x.command_V):
        return np.zeros(frequencies.size, dtype=bool)
    base_Hz = sine_frequency_Hz(x.time_s, x.command_V)
    apart = np.abs(frequencies - base_Hz * np.maximum(1.0, np.round(frequencies / base_Hz)))
    return np.asarray(apart < LINES_APART / float(np.ptp(x.time_s)))
