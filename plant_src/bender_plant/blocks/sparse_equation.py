"""A learned equation in general form: the rate of the displacement as a sum of few terms.

    w' = sum_k c_k w^p |w|^q u^r |u|^s (1, u' or |u'|)

with u in V and w in um: what sparse regression (SINDy, Brunton, Proctor and Kutz, PNAS 113, 2016) finds in a library
of polynomial and Bouc-Wen terms. A term without rate runs with time, one with u' or |u'| along the path of the voltage,
so no derivative of the voltage is needed and a step of u is just a stretch of that path. A higher power of u' would
make the answer to a step depend on how fast the step is, and is not allowed. The defaults are equation (30).

Classical Runge-Kutta in pieces that are short beside the relaxation, cut where w passes zero (|w| has its kink there).
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from bender_plant.parabola import turning_point, value
from bender_plant.parameter import ModelError, check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "sparse_equation"
STAGE = "material"
TITLE = "Learned equation, a sum of terms"
TRANSDUCER = True
MEMORY = True
FACTORS = ("w", "|w|", "u", "|u|", "u'", "|u'|")
HIGHEST_POWER = 9
# the state up to which a sub-step is sized, and the part of the time constant there that it takes
STROKE_UM = 25.0
SPAN_V = 50.0
STEP_PART = 0.03
# one Runge-Kutta piece in parts of the relaxation, and the pieces beyond which the equation is taken to run away
PIECE = 0.05
MOST_PIECES = 1e4
RUNAWAY_UM = 1e7

_Numbers = tuple[float, ...]
_Constants = tuple[_Numbers, _Numbers, _Numbers, _Numbers, _Numbers, _Numbers]


class Powers(NamedTuple):
    """Exponents of one term: of w, |w|, u, |u|, and its rate: 0 none, 1 for u', 2 for |u'|."""

    w: int
    magnitude: int
    u: int
    voltage_magnitude: int
    rate: int


def powers_of(term: str) -> Powers:
    """Read a term such as `w |w|` or `u^2 u'`: factors with a space between.

    Raises:
        ModelError: a factor is unknown, a power is not 1 to 9, there are two rates, or the term is constant at rest.
    """
    counts = dict.fromkeys(FACTORS, 0)
    for word in term.split():
        name, caret, power = word.partition("^")
        if name not in counts or (caret and power not in "123456789") or (caret and len(power) != 1):
            expected = f"factors {' '.join(FACTORS)} with a space between, each with ^2 to ^9 or without"
            raise ModelError(f"{ID}.terms: found {word!r} in {term!r}, expected {expected}")
        counts[name] += int(power) if caret else 1
    if counts["u'"] + counts["|u'|"] > 1:
        raise ModelError(f"{ID}.terms: found {term!r}, expected u' or |u'| once at most: steps have no rate")
    if not any(counts.values()):
        raise ModelError(f"{ID}.terms: found {term!r}, expected a term that is zero at rest; an offset is calibration")
    if max(counts.values()) > HIGHEST_POWER:
        raise ModelError(f"{ID}.terms: found {term!r}, expected powers up to {HIGHEST_POWER}")
    rate = 1 if counts["u'"] else 2 if counts["|u'|"] else 0
    return Powers(counts["w"], counts["|w|"], counts["u"], counts["|u|"], rate)


@dataclass(frozen=True, slots=True)
class Parameters:
    """The terms and the factor of each, in um, V and s."""

    terms: tuple[str, ...] = ("w", "u", "u'", "|w|", "w |w|")
    coefficients: tuple[float, ...] = parameter(
        (-0.48, 1.652, 0.818, -0.22, -0.124),
        unit="1",
        low=-1e12,
        high=1e12,
        text="factor of each term, in the um, V and s of that term",
        tunable=True,
    )

    def __post_init__(self) -> None:
        check(self, ID)
        if not isinstance(self.terms, tuple) or not self.terms:
            raise ModelError(f"{ID}.terms: found {self.terms!r}, expected a list of terms")
        for term in self.terms:
            if not isinstance(term, str):
                raise ModelError(f'{ID}.terms: found {term!r}, expected a term such as "w |w|"')
        if len(self.terms) != len(self.coefficients):
            found = f"{len(self.terms)} terms and {len(self.coefficients)} coefficients"
            raise ModelError(f"{ID}.coefficients: found {found}, expected the same number of each")
        known: dict[Powers, str] = {}
        for term in self.terms:
            powers = powers_of(term)
            if powers in known:
                raise ModelError(f"{ID}.terms: found {known[powers]!r} and {term!r}, expected each term once")
            known[powers] = term


def constants(settings: Parameters, beam: "CompositeBeam | None") -> _Constants:
    """Return for every term its coefficient, degree in |w|, oddness in w, degree in |u|, oddness in u, and rate."""
    del beam
    powers = [powers_of(term) for term in settings.terms]
    return (
        settings.coefficients,
        tuple(float(x.w + x.magnitude) for x in powers),
        tuple(float(x.w % 2) for x in powers),
        tuple(float(x.u + x.voltage_magnitude) for x in powers),
        tuple(float(x.u % 2) for x in powers),
        tuple(float(x.rate) for x in powers),
    )


def initial(constants: _Constants) -> tuple[float, ...]:
    """Return (w, last u) at rest."""
    del constants
    return (0.0, 0.0)


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the longest sub-step: a small part of the shortest time constant over the stroke."""
    del beam
    quickest = 0.0
    for c, n, _, m, _, rate in zip(*constants(settings, None), strict=True):
        if rate == 0.0 and n > 0.0:
            quickest += n * abs(c) * STROKE_UM ** (n - 1.0) * SPAN_V**m
    limit = STEP_PART / quickest if quickest > 0.0 else math.inf
    return limit, limit


def corner(state: tuple[float, ...], constants: _Constants, h: float, u0: float, um: float, u1: float) -> float:
    """Return the fraction of the sub-step at which the voltage turns, 1 where it does not."""
    del state, constants, h
    return turning_point(u0, um, u1)


def slope(w: float, u: float, h: float, du: float, constants: _Constants) -> float:
    """Return the change of w over a time h in which the voltage changes by du, at the state of its start."""
    coefficients, w_degree, w_odd, u_degree, u_odd, rate = constants
    along = (h, du, abs(du))
    w_size, u_size = abs(w), abs(u)
    total = 0.0
    for k in range(len(coefficients)):
        x = coefficients[k] * along[int(rate[k])]
        for _ in range(int(w_degree[k])):
            x *= w_size
        for _ in range(int(u_degree[k])):
            x *= u_size
        if (w < 0.0 and w_odd[k] == 1.0) != (u < 0.0 and u_odd[k] == 1.0):
            x = -x
        total += x
    return total


def bounds(w: float, u: float, h: float, du: float, constants: _Constants) -> tuple[float, float]:
    """Return bounds of what the voltage alone moves over such a stretch and of what relaxes, up to |w| and |u|."""
    coefficients, w_degree, _, u_degree, _, rate = constants
    along = (h, abs(du), abs(du))
    moved = 0.0
    for k in range(len(coefficients)):
        if w_degree[k] == 0.0:
            moved += abs(coefficients[k]) * along[int(rate[k])] * u ** u_degree[k]
    reach = w + moved
    relaxed = 0.0
    for k in range(len(coefficients)):
        n = w_degree[k]
        if n > 0.0:
            relaxed += n * abs(coefficients[k]) * along[int(rate[k])] * reach ** (n - 1.0) * u ** u_degree[k]
    return moved, relaxed


def runge_kutta(
    w: float, a: float, x: float, h: float, u0: float, um: float, u1: float, constants: _Constants
) -> float:
    """Return w after the fraction x of the sub-step that begins at the fraction a."""
    first = 4.0 * um - 3.0 * u0 - u1
    bend = 4.0 * (u0 + u1 - 2.0 * um)
    m, b = a + 0.5 * x, a + x
    middle = value(u0, um, u1, m)
    rate = first + bend * m
    part = x * h
    k1 = slope(w, value(u0, um, u1, a), part, x * (first + bend * a), constants)
    k2 = slope(w + 0.5 * k1, middle, part, x * rate, constants)
    k3 = slope(w + 0.5 * k2, middle, part, x * rate, constants)
    k4 = slope(w + k3, value(u0, um, u1, b), part, x * (first + bend * b), constants)
    return w + (k1 + 2.0 * (k2 + k3) + k4) / 6.0


def to_zero(w: float, a: float, x: float, h: float, u0: float, um: float, u1: float, constants: _Constants) -> float:
    """Return the fraction, up to x, after which w is zero: a piece in which it changes sign is cut there."""
    low, high = 0.0, x
    for _ in range(60):
        middle = 0.5 * (low + high)
        there = runge_kutta(w, a, middle, h, u0, um, u1, constants)
        # by their signs: the product of a small and a tiny number is zero
        if (there > 0.0 and w > 0.0) or (there < 0.0 and w < 0.0):
            low = middle
        else:
            high = middle
        if high - low <= 1e-12 * x:
            break
    return high


def advance(w: float, h: float, u0: float, um: float, u1: float, constants: _Constants) -> float:
    """Return w after a sub-step of length h with the voltage on a parabola."""
    span = max(abs(u0), abs(um), abs(u1))
    travel = 2.0 * max(abs(um - u0), abs(u1 - um))
    pieces = bounds(abs(w), span, h, travel, constants)[1] / PIECE
    if not (pieces < MOST_PIECES and abs(w) < RUNAWAY_UM):
        return math.nan
    count = 1 + int(pieces)
    x = 1.0 / count
    for k in range(count):
        begin = k * x
        after = runge_kutta(w, begin, x, h, u0, um, u1, constants)
        if after < 0.0 < w or w < 0.0 < after:
            cut = to_zero(w, begin, x, h, u0, um, u1, constants)
            after = runge_kutta(0.0, begin + cut, x - cut, h, u0, um, u1, constants)
        w = after
    return w


def step(
    state: tuple[float, ...],
    constants: _Constants,
    time_s: float,
    h: float,
    u0: float,
    um: float,
    u1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Advance along last voltage -> u0 in no time, then over the sub-step."""
    del time_s
    w, last = state
    if last != u0:
        w = advance(w, 0.0, last, 0.5 * (last + u0), u0, constants)
    end = advance(w, h, u0, um, u1, constants)
    # the middle by the cubic through both ends
    begins = slope(w, u0, h, 4.0 * um - 3.0 * u0 - u1, constants)
    ends = slope(end, u1, h, u0 + 3.0 * u1 - 4.0 * um, constants)
    return (end, u1), w, 0.5 * (w + end) + 0.125 * (begins - ends), end
