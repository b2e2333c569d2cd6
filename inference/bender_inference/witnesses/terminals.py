"""Which effect of the supply a voltage shows that was read back, and what it leaves of the others.

It is that of the supply's terminals, or of the electrodes. These lie behind the leads, so they bound the lag of a
resistance there as well.

Read-backs are independent of the readings of the tip, so an effect that they show is there whatever else is missing.
Hypotheses are weighed as those of the readings are: by the likelihood of what they leave, its variance profiled out but
never below that of the meter, with as many samples as its correlation leaves.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bender_effects.catalogue import EFFECTS
from bender_effects.form import Form
from bender_inference.fitting.criterion import autocorrelation_time, very_strong
from bender_inference.search.judgement.rules import RULES
from bender_inference.witnesses.read_back import Array, ReadBack

WITNESSED = {name: x.witnessed for name, x in EFFECTS.items() if x.witnessed is not None and x.witnessed.by_voltage}
"""What a supply may do to a command before its terminals, or leads before the electrodes."""
BEFORE_TERMINALS = tuple(name for name, x in WITNESSED.items() if x.before_terminals)
BEFORE_ELECTRODES = tuple(name for name, x in WITNESSED.items() if x.before_electrodes)
"""Those of them that nothing behind the terminals, or behind the electrodes, does."""
ROOM = 1.5
"""Between what read-backs admit and what they exclude: forms are not nature's."""
MOST_NOISE = 0.1
"""Part of the range of the commands: a meter with more noise is none."""
NOISES = 5.0
"""What read-backs are off by is nothing but the meter where it is less than so many times its noise, rms."""
PER_DECADE, STEPS_PER_DECADE, DELAYS, CLOSELY = 12, 300, 60, 13
"""Values that are tried: of a scale, of a step, whose misfit has many narrow valleys, of a delay; around the best."""
BOUNDS_PER_DECADE = 40
APART, MOST_ALIKE = 0.01, 6
"""Relative difference of values that count as two, and how many are kept."""
LEADING = 40
"""Of these, those whose likelihood is computed."""
DEVIATIONS = 25.0
"""Five standard deviations of a number, in the criterion."""


@dataclass(frozen=True, slots=True)
class Shown:
    """An effect that the read-backs show.

    Attributes:
        effect: the contract's id.
        values: of its number, the likeliest first: of a step there may be several that few levels leave.
        low, high: ends of what the read-backs leave of it.
    """

    effect: str
    values: tuple[float, ...]
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Terminals:
    """What the read-backs of all records say together.

    Attributes:
        shown: the effects of which one is there; the read-backs do not distinguish them where they are several.
        limits: (effect, low, high): the values that the read-backs allow the number of another effect of the supply.
    """

    shown: tuple[Shown, ...] = ()
    limits: tuple[tuple[str, float, float], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """A form with its best number, what it leaves, what every number that was tried leaves, and others as likely."""

    form: Form | None
    value: float
    squares_V2: tuple[float, ...]
    unlikelihoods: tuple[float, ...]
    tried: tuple[tuple[float, tuple[float, ...]], ...] = ()
    alike: tuple[float, ...] = ()


def judge_voltages(
    read: Sequence[ReadBack], forms: Sequence[Form], confidence: float, only_before: Sequence[str] = BEFORE_TERMINALS
) -> Terminals:
    """Return what the read-backs of the records of one bench say.

    Args:
        read: those of every record that has some.
        forms: of the effects of the catalogue; those before the terminals count, where they have one number.
        confidence: of what is said.
        only_before: effects that lie nowhere but before the place where the voltage was read.
    """
    usable = [x for x in read if x.noise_V <= MOST_NOISE * x.span_V]
    if not usable:
        return Terminals()
    supply = [x for x in forms if x.effect in WITNESSED and len(x.free) == 1]
    bound = [x for x in supply if x.effect in only_before]
    plain = _Fit(None, 0.0, _squares(usable, None, 0.0), _unlikelihoods(usable, None, 0.0))
    by = _Scale(usable, plain)
    if by.of(plain.squares_V2) - by.floor() <= _threshold(1, confidence):
        return Terminals((), _limits(usable, bound, plain, by, confidence))
    fits = [_fitted(usable, x) for x in supply]
    best = min(fits, key=lambda x: sum(x.unlikelihoods), default=plain)
    by = _Scale(usable, best)
    tried = sum(len(x.tried) for x in fits)
    if by.cost(plain) - by.cost(best) <= _threshold(tried, confidence):
        follows = _rms_over_noise(usable, plain) <= NOISES
        return Terminals((), _limits(usable, bound, plain, by, confidence)) if follows else Terminals()
    if _closed(usable, plain, best) < RULES.closes:
        return Terminals()
    alike = [x for x in fits if by.cost(x) - by.cost(best) <= very_strong(confidence)]
    shown = tuple(_shown(x, by) for x in sorted(alike, key=by.cost))
    if _rms_over_noise(usable, best) > NOISES:  # another effect may act beside the one that is shown
        return Terminals(shown)
    names = {x.effect for x in shown}
    return Terminals(shown, tuple((x, math.inf, -math.inf) for x in only_before if x not in names))


class _Scale:
    """Weighs fits by a likelihood, with as many samples as the residual of one of them leaves."""

    def __init__(self, read: Sequence[ReadBack], fit: _Fit) -> None:
        self._read = read
        residuals = [x.residual_V(fit.form, fit.value) for x in read]
        self._counts = [r.size / autocorrelation_time(r, np.ones(r.size, dtype=np.bool_)) for r in residuals]

    def of(self, squares_V2: Sequence[float]) -> float:
        """Return twice the negative log-likelihood of how far read-backs lie outside; sums of squares by record."""
        rows = zip(self._counts, self._read, squares_V2, strict=True)
        return sum(n * math.log(max(s / x.read_V.size, x.noise_V**2)) for n, x, s in rows)

    def cost(self, fit: _Fit) -> float:
        """Return the criterion of a fit: its likelihood, and the price of its number."""
        price = 0.0 if fit.form is None else math.log(max(sum(self._counts), math.e))
        rows = zip(self._counts, self._read, fit.unlikelihoods, strict=True)
        return sum(x * n / one.read_V.size for n, one, x in rows) + price

    def floor(self) -> float:
        """Return what the noise of the meters alone would cost."""
        return self.of([0.0] * len(self._read))


def _threshold(tried: int, confidence: float) -> float:
    return 2.0 * math.log(max(tried, 1)) + very_strong(confidence)


def _squares(read: Sequence[ReadBack], form: Form | None, value: float) -> tuple[float, ...]:
    residuals = (x.residual_V(form, value) for x in read)
    return tuple(float(r @ r) for r in residuals)


def _rms_over_noise(read: Sequence[ReadBack], fit: _Fit) -> float:
    rows = zip(read, fit.squares_V2, strict=True)
    return max(math.sqrt(s / x.read_V.size) / x.noise_V for x, s in rows)


def _unlikelihoods(read: Sequence[ReadBack], form: Form | None, value: float) -> tuple[float, ...]:
    return tuple(x.unlikelihood(form, value) for x in read)


def _closed(read: Sequence[ReadBack], plain: _Fit, best: _Fit) -> float:
    """Return the part of what following terminals leave above the meters' noise that a fit closes."""
    floor = sum(x.read_V.size * x.noise_V**2 for x in read)
    gap, left = (max(sum(x.squares_V2) - floor, 0.0) for x in (plain, best))
    return 1.0 - left / gap if gap > 0.0 else 0.0


def _values(form: Form, per_decade: int) -> Array:
    """Return the values of a form's number that are tried."""
    free = form.free[0]
    if not free.log:
        return np.linspace(free.low, 0.5 * free.high, DELAYS + 1)[1:]
    return np.geomspace(free.low, free.high, round(per_decade * math.log10(free.high / free.low)) + 1)


def _fitted(read: Sequence[ReadBack], form: Form) -> _Fit:
    """Return a form with its best number: the best of all values, then of those around it, twice."""
    values = _values(form, STEPS_PER_DECADE if form.free[0].jumps else PER_DECADE)
    if form.free[0].jumps:  # finer ones drown in the noise, and wider ones let nothing out
        noise_V, span_V = max(x.noise_V for x in read), max(x.span_V for x in read)
        values = values[(values >= NOISES * noise_V) & (values <= 2.0 * span_V)]
        left = sum(x.left_by_steps_V2(values) for x in read)
        values = values[np.argsort(left)[:LEADING]]
    if not values.size:
        values = np.array([form.free[0].high])
    tried = [(float(x), _squares(read, form, float(x))) for x in values]
    for _ in range(2):
        tried.sort(key=lambda x: x[0])
        k = min(range(len(tried)), key=lambda j: sum(tried[j][1]))
        low, high = tried[max(k - 1, 0)][0], tried[min(k + 1, len(tried) - 1)][0]
        tried += [(float(x), _squares(read, form, float(x))) for x in np.linspace(low, high, CLOSELY)[1:-1]]
    tried.sort(key=lambda x: sum(x[1]))
    leading = [(sum(y := _unlikelihoods(read, form, value)), value, squares, y) for value, squares in tried[:LEADING]]
    leading.sort()
    least, value, squares, unlikelihoods = leading[0]
    alike = [value]
    for cost, other, *_ in leading[1:] if form.free[0].jumps else ():
        if cost - least <= DEVIATIONS and all(abs(other / x - 1.0) > APART for x in alike):
            alike.append(other)
    return _Fit(form, value, squares, unlikelihoods, tuple(tried), tuple(alike[:MOST_ALIKE]))


def _shown(fit: _Fit, by: _Scale) -> Shown:
    assert fit.form is not None
    least = min(by.of(squares) for _, squares in fit.tried)
    left = [value for value, squares in fit.tried if by.of(squares) - least <= DEVIATIONS]
    return Shown(fit.form.effect, fit.alike, min(left) / ROOM, max(left) * ROOM)


def _limits(
    read: Sequence[ReadBack], forms: Sequence[Form], plain: _Fit, by: _Scale, confidence: float
) -> tuple[tuple[str, float, float], ...]:
    """Return what terminals that follow leave of each effect before them."""
    most = by.of(plain.squares_V2) + very_strong(confidence)
    found = []
    for form in forms:
        side = WITNESSED[form.effect].excludes
        if not side:
            continue
        rising = side == "below"
        values = _values(form, BOUNDS_PER_DECADE)
        values = values if rising else values[::-1]
        admitted = next((float(x) for x in values if by.of(_squares(read, form, float(x))) <= most), float(values[-1]))
        if admitted == values[0]:
            continue
        found.append((form.effect, admitted / ROOM if rising else 0.0, math.inf if rising else admitted * ROOM))
    return tuple(found)
