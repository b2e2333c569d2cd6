"""A sparse equation for the residual of a model, without a named cause: it adds r to the displacement, y -> y + r.

    r = sum_k c_k v^m |v|^i y^n |y|^j (1, y' or |y'|)                             gives = "value"
    r' = sum_k c_k r^p |r|^q v^m |v|^i y^n |y|^j (1, v', |v'|, y' or |y'|)         gives = "rate"

with r and y in um, the voltage v that enters the transducer in V: a sparse equation (SINDy, Brunton, Proctor and Kutz,
PNAS 113, 2016) in terms of the voltage and of the simulated displacement. r stands at most once in a term, so that the
equation is linear in it. It knows nothing outside of the record that it was learned from: v and y stop at the ends of
that range, and r at the largest value that it had there.

Terms with a rate run along the path of voltage and displacement, so that a jump is a stretch of that path.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from bender_plant.parabola import turning_point, value
from bender_plant.parameter import ModelError, check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "residual_equation"
STAGE = "structure"
TITLE = "Equation for the residual"
MEMORY = True
BESIDE = "voltage"
FACTORS = ("r", "|r|", "v", "|v|", "y", "|y|")
RATES = ("v'", "|v'|", "y'", "|y'|")
GIVES = ("value", "rate")
HIGHEST_POWER = 9
# a piece of a sub-step in parts of the relaxation, and the most of them: quicker is at its end within one
PIECE = 0.2
MOST_PIECES = 1000.0
STEP_PART = 0.1

_Numbers = tuple[float, ...]
_Constants = tuple[
    _Numbers, _Numbers, _Numbers, _Numbers, _Numbers, _Numbers, _Numbers, _Numbers, float, float, float, float, float,
    float,
]  # fmt: skip


class Powers(NamedTuple):
    """Exponents of one term, and its rate: 0 none, 1 for v', 2 for |v'|, 3 for y', 4 for |y'|."""

    r: int
    r_magnitude: int
    v: int
    v_magnitude: int
    y: int
    y_magnitude: int
    rate: int


def powers_of(term: str, gives: str) -> Powers:
    """Read a term such as `r |v'|` or `v^2 y`: factors with a space between, `1` for a constant.

    Raises:
        ModelError: a factor is unknown, a power is not 1 to 9, r stands twice, there are two rates, or the equation of
            a value has r or v' in it.
    """
    counts = dict.fromkeys((*FACTORS, *RATES), 0)
    for word in term.split():
        name, caret, power = word.partition("^")
        if word == "1":
            continue
        if name not in counts or (caret and (power not in "123456789" or len(power) != 1)):
            expected = f"factors {' '.join(counts)} with a space between, each with ^2 to ^9 or without, or 1"
            raise ModelError(f"{ID}.terms: found {word!r} in {term!r}, expected {expected}")
        counts[name] += int(power) if caret else 1
    if max(counts.values()) > HIGHEST_POWER:
        raise ModelError(f"{ID}.terms: found {term!r}, expected powers up to {HIGHEST_POWER}")
    if counts["r"] + counts["|r|"] > 1:
        raise ModelError(f"{ID}.terms: found {term!r}, expected r or |r| once at most")
    rates = [k for k, x in enumerate(RATES, 1) for _ in range(counts[x])]
    if len(rates) > 1:
        raise ModelError(f"{ID}.terms: found {term!r}, expected one of {' '.join(RATES)} once at most")
    if gives == "value" and (counts["r"] or counts["|r|"] or rates in ([1], [2])):
        raise ModelError(f"{ID}.terms: found {term!r}, expected no r and no v' where the equation gives a value")
    r, r_magnitude, v, v_magnitude, y, y_magnitude = (counts[x] for x in FACTORS)
    return Powers(r, r_magnitude, v, v_magnitude, y, y_magnitude, rates[0] if rates else 0)


@dataclass(frozen=True, slots=True)
class Parameters:
    """The terms, the factor of each, and where they were learned. Neutral at zero."""

    terms: tuple[str, ...] = ("v",)
    coefficients: tuple[float, ...] = parameter(
        (0.0,),
        unit="1",
        low=-1e12,
        high=1e12,
        text="factor of each term, in the um, V and s of that term",
        tunable=True,
    )
    gives: str = "value"
    lowest_voltage_V: float = parameter(-1e12, unit="V", text="lowest voltage that it was learned from")
    highest_voltage_V: float = parameter(1e12, unit="V", text="highest voltage that it was learned from")
    lowest_displacement_um: float = parameter(-1e12, unit="um", text="lowest displacement that it was learned from")
    highest_displacement_um: float = parameter(1e12, unit="um", text="highest displacement that it was learned from")
    largest_residual_um: float = parameter(
        1e12, unit="um", low=0.0, text="largest magnitude that it gave where it was learned"
    )

    def __post_init__(self) -> None:
        check(self, ID)
        if self.gives not in GIVES:
            raise ModelError(f"{ID}.gives: found {self.gives!r}, expected {' or '.join(map(repr, GIVES))}")
        if not isinstance(self.terms, tuple) or not self.terms or not all(isinstance(x, str) for x in self.terms):
            raise ModelError(f'{ID}.terms: found {self.terms!r}, expected a list of terms such as "r |v\'|"')
        if not isinstance(self.coefficients, tuple) or len(self.terms) != len(self.coefficients):
            raise ModelError(
                f"{ID}.coefficients: found {self.coefficients!r} for {len(self.terms)} terms, expected one for each"
            )
        known: dict[Powers, str] = {}
        for term in self.terms:
            powers = powers_of(term, self.gives)
            if powers in known:
                raise ModelError(f"{ID}.terms: found {known[powers]!r} and {term!r}, expected each term once")
            known[powers] = term
        for name, low, high in (
            ("lowest_voltage_V", self.lowest_voltage_V, self.highest_voltage_V),
            ("lowest_displacement_um", self.lowest_displacement_um, self.highest_displacement_um),
        ):
            if low > high:
                raise ModelError(f"{ID}.{name}: found {low!r} above the highest, {high!r}, expected no more than that")


def constants(settings: Parameters, beam: "CompositeBeam | None") -> _Constants:
    """Return the coefficient, degrees and oddness in r, v and y, and rate of every term; then the kind and range."""
    del beam
    powers = [powers_of(term, settings.gives) for term in settings.terms]
    return (
        settings.coefficients,
        tuple(float(x.r + x.r_magnitude) for x in powers),
        tuple(float(x.r % 2) for x in powers),
        tuple(float(x.v + x.v_magnitude) for x in powers),
        tuple(float(x.v % 2) for x in powers),
        tuple(float(x.y + x.y_magnitude) for x in powers),
        tuple(float(x.y % 2) for x in powers),
        tuple(float(x.rate) for x in powers),
        float(GIVES.index(settings.gives)),
        settings.lowest_voltage_V,
        settings.highest_voltage_V,
        settings.lowest_displacement_um,
        settings.highest_displacement_um,
        settings.largest_residual_um,
    )


def initial(constants: _Constants) -> tuple[float, ...]:
    """Return (r, last v, last y) at rest."""
    del constants
    return (0.0, 0.0, 0.0)


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the longest sub-step: a part of the shortest relaxation within the range; inf where nothing relaxes."""
    del beam
    quickest = 0.0
    v = max(abs(settings.lowest_voltage_V), abs(settings.highest_voltage_V))
    y = max(abs(settings.lowest_displacement_um), abs(settings.highest_displacement_um))
    for c, term in zip(settings.coefficients, settings.terms, strict=True):
        x = powers_of(term, settings.gives)
        if x.rate == 0 and x.r + x.r_magnitude:
            degree_v, degree_y = x.v + x.v_magnitude, x.y + x.y_magnitude
            # an unbounded range says nothing of what will act
            quickest += abs(c) * (v**degree_v if v < 1e12 else 1.0) * (y**degree_y if y < 1e12 else 1.0)
    limit = STEP_PART / quickest if quickest > 0.0 else math.inf
    return limit, limit


def total(
    r: float, v: float, y: float, alone: float, dv: float, dy: float, constants: _Constants, relaxing: float
) -> float:
    """Return the sum of the terms with r in them (relaxing = 1) or without (0), each along its own stretch.

    `alone` goes with terms without a rate, dv and dy with those that have one.
    """
    coefficients, r_degree, r_odd, v_degree, v_odd, y_degree, y_odd, rate, _, _, _, _, _, _ = constants
    along = (alone, dv, abs(dv), dy, abs(dy))
    found = 0.0
    for k in range(len(coefficients)):
        x = coefficients[k] * along[int(rate[k])]
        for _ in range(int(v_degree[k])):
            x *= abs(v)
        for _ in range(int(y_degree[k])):
            x *= abs(y)
        if v < 0.0 and v_odd[k] == 1.0:
            x = -x
        if y < 0.0 and y_odd[k] == 1.0:
            x = -x
        if relaxing == 1.0 and r < 0.0 and r_odd[k] == 0.0:
            x = -x
        if r_degree[k] == relaxing:
            found += x
    return found


def slopes(u0: float, um: float, u1: float, x: float) -> float:
    """Return the change of a signal per sub-step at the fraction x of it."""
    return 4.0 * um - 3.0 * u0 - u1 + 4.0 * (u0 + u1 - 2.0 * um) * x


def piece(
    r: float, a: float, b: float, h: float, v: tuple[float, float, float], y: tuple[float, float, float],
    constants: _Constants,
) -> float:  # fmt: skip
    """Return r after the part from a to b of a sub-step: Simpson's rule, exact where what r relaxes by is constant."""
    part = b - a
    added = exponent = 0.0
    for k in range(3):
        x = a + 0.5 * k * part
        weight = part * (4.0 if k == 1 else 1.0) / 6.0
        here_v, here_y = value(v[0], v[1], v[2], x), value(y[0], y[1], y[2], x)
        dv, dy = slopes(v[0], v[1], v[2], x), slopes(y[0], y[1], y[2], x)
        added += weight * total(r, here_v, here_y, h, dv, dy, constants, 0.0)
        exponent += weight * total(r, here_v, here_y, h, dv, dy, constants, 1.0)
    exponent = min(max(exponent, -30.0), 30.0)
    growth = math.expm1(exponent)
    mean = growth / exponent if abs(exponent) > 1e-9 else 1.0 + 0.5 * exponent
    most = constants[13]
    return min(max((1.0 + growth) * r + mean * added, -most), most)


def stretch(
    r: float, a: float, b: float, h: float, v: tuple[float, float, float], y: tuple[float, float, float],
    constants: _Constants,
) -> float:  # fmt: skip
    """Return r after the part from a to b of a sub-step of length h with voltage and displacement on parabolas."""
    size = 0.0
    for k in range(3):
        x = a + 0.5 * k * (b - a)
        here_v, here_y = value(v[0], v[1], v[2], x), value(y[0], y[1], y[2], x)
        dv, dy = slopes(v[0], v[1], v[2], x), slopes(y[0], y[1], y[2], x)
        size = max(size, abs(total(1.0, here_v, here_y, h, dv, dy, constants, 1.0)))
    count = 1 + int(min((b - a) * size / PIECE, MOST_PIECES))
    for k in range(count):
        first = a + (b - a) * k / count
        r = piece(r, first, a + (b - a) * (k + 1) / count, h, v, y, constants)
    return r


def corner(
    state: tuple[float, ...], constants: _Constants, h: float,
    y0: float, ym: float, y1: float, v0: float, vm: float, v1: float,
) -> float:  # fmt: skip
    """Return the fraction of the sub-step at which v or y turns round, where a term has the magnitude of its rate."""
    del state, h
    rate = constants[7]
    fraction = 1.0
    for k in range(len(rate)):
        if rate[k] == 2.0:
            fraction = min(fraction, turning_point(v0, vm, v1))
        elif rate[k] == 4.0:
            fraction = min(fraction, turning_point(y0, ym, y1))
    return fraction


def beside(
    state: tuple[float, ...], constants: _Constants, time_s: float, h: float,
    y0: float, ym: float, y1: float, v0: float, vm: float, v1: float,
) -> tuple[tuple[float, ...], float, float, float]:  # fmt: skip
    """Add r: at once from voltage and displacement, or along the path from the last ones and over the sub-step."""
    del time_s
    low_V, high_V, low_um, high_um, most = constants[9], constants[10], constants[11], constants[12], constants[13]
    v = (min(max(v0, low_V), high_V), min(max(vm, low_V), high_V), min(max(v1, low_V), high_V))
    y = (min(max(y0, low_um), high_um), min(max(ym, low_um), high_um), min(max(y1, low_um), high_um))
    if constants[8] == 0.0:
        rates = ((4.0 * y[1] - 3.0 * y[0] - y[2]) / h, (y[2] - y[0]) / h, (y[0] + 3.0 * y[2] - 4.0 * y[1]) / h)
        start = total(0.0, v[0], y[0], 1.0, 0.0, rates[0], constants, 0.0)
        middle = total(0.0, v[1], y[1], 1.0, 0.0, rates[1], constants, 0.0)
        end = total(0.0, v[2], y[2], 1.0, 0.0, rates[2], constants, 0.0)
        start, middle, end = min(max(start, -most), most), min(max(middle, -most), most), min(max(end, -most), most)
        return (end, v[2], y[2]), y0 + start, ym + middle, y1 + end
    r, last_v, last_y = state
    if last_v != v[0] or last_y != y[0]:
        path_v, path_y = (last_v, 0.5 * (last_v + v[0]), v[0]), (last_y, 0.5 * (last_y + y[0]), y[0])
        r = stretch(r, 0.0, 1.0, 0.0, path_v, path_y, constants)
    half = stretch(r, 0.0, 0.5, h, v, y, constants)
    end = stretch(half, 0.5, 1.0, h, v, y, constants)
    return (end, v[2], y[2]), y0 + r, ym + half, y1 + end
