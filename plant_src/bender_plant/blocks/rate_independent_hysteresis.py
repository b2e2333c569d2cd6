"""Rate-independent hysteresis beside a transducer that has none: w -> w + h.

    "plays"      h = sum_k [p_k (F_k - v) + q_k (F_k^2 - v^2) + c_k (F_k^3 - v^3)] + s_1 v + s_2 v^2 + s_3 v^3,
                 F_k(v) the play of half-width r_k: F_k - v is what a play lags behind its voltage
    "bouc_wen"   h = z + s_1 v + s_2 v^2 + s_3 v^3,   z' = alpha v' - beta |v'| z - gamma v' |z|

Domain walls that jump from one pinning site to the next: the loop of h over v is the same at every speed, its area
grows with more than the square of the amplitude, and something stays at zero voltage (remanence). Ceramics show 10 %
to 15 % of the span; the paper's actuator shows a loop of at most 8.8 %.

With the p_k alone the plays are those of Prandtl and Ishlinskii, whose loops are point-symmetric. Every Preisach
operator is an integral of functions of plays over their half-widths (Brokate and Sprekels 1996, section 2.4); the
squares and cubes are the first terms of these functions, s_1 to s_3 those of the part that returns the way it came.
A plant that was never driven begins with every play in its middle. One that has been in use, and stands at 0 V, begins
where its plays came to rest after the voltage `reached_V`: h counts from there, so that its first cycle is as all later
ones (the one-sided plays of unipolar actuators, Kuhnen 2003, doi:10.3166/ejc.9.407-418).
Beyond the voltages that they were learned from, the latter runs on along the line from 0 V through its end, whose slope
the records tell far better than that of the curve there, and the plays weigh what they weigh at the end.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.bouc_wen import along
from bender_plant.kernels.play import engagement, passed, play
from bender_plant.kernels.state import of_any_length
from bender_plant.parabola import turning_point
from bender_plant.parameter import ModelError, check, check_straight, curve_end, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "rate_independent_hysteresis"
STAGE = "material"
TITLE = "Rate-independent hysteresis"
MEMORY = True
STATE_OF_ANY_LENGTH = True
BESIDE = "voltage"
FORMS = ("plays", "bouc_wen")

_Many = tuple[float, ...]
_Constants = tuple[_Many, _Many, _Many, _Many, float, float, float, float, float, float, float, float, float, _Many]


@dataclass(frozen=True, slots=True)
class Parameters:
    """Plays, or the coefficients of Bouc-Wen; what the form does not use stays neutral."""

    form: str = "plays"
    thresholds_V: tuple[float, ...] = parameter((), unit="V", low=0.0, text="r_k, half-width of each play")
    weights_um_per_V: tuple[float, ...] = parameter((), unit="um/V", text="p_k, weight of each play", tunable=True)
    quadratic_um_per_V2: tuple[float, ...] = parameter(
        (), unit="um/V2", text="q_k, weight of the square of each play", tunable=True
    )
    cubic_um_per_V3: tuple[float, ...] = parameter(
        (), unit="um/V3", text="c_k, weight of the cube of each play", tunable=True
    )
    reversible_linear_um_per_V: float = parameter(
        0.0, unit="um/V", text="s_1, slope of the curve beside the loop", tunable=True
    )
    reversible_quadratic_um_per_V2: float = parameter(
        0.0, unit="um/V2", text="s_2, square in the curve beside the loop", tunable=True
    )
    reversible_cubic_um_per_V3: float = parameter(
        0.0, unit="um/V3", text="s_3, cube in the curve beside the loop", tunable=True
    )
    alpha_um_per_V: float = parameter(0.0, unit="um/V", text="alpha, initial slope of h", tunable=True)
    beta_1_per_V: float = parameter(0.0, unit="1/V", low=0.0, text="beta, how soon a branch levels off", tunable=True)
    gamma_1_per_V: float = parameter(
        0.0, unit="1/V", text="gamma, how the branches differ in that; not above beta in size", tunable=True
    )
    reached_V: float = parameter(0.0, unit="V", text="voltage that plays reached before they rested at 0 V")
    straight_below_V: float = curve_end(-1e12, "lowest")
    straight_above_V: float = curve_end(1e12, "highest")

    def __post_init__(self) -> None:
        check(self, ID)
        check_straight(ID, self.straight_below_V, self.straight_above_V)
        if self.form not in FORMS:
            raise ModelError(f"{ID}.form: found {self.form!r}, expected one of {FORMS}")
        if len(self.thresholds_V) != len(self.weights_um_per_V):
            found = f"{len(self.thresholds_V)} thresholds and {len(self.weights_um_per_V)} weights"
            raise ModelError(f"{ID}.weights_um_per_V: found {found}, expected the same number of each")
        for name in ("quadratic_um_per_V2", "cubic_um_per_V3"):
            count = len(getattr(self, name))
            if count not in (0, len(self.thresholds_V)):
                found = f"{count} numbers for {len(self.thresholds_V)} plays"
                raise ModelError(f"{ID}.{name}: found {found}, expected none, or one for each play")
        if abs(self.gamma_1_per_V) > self.beta_1_per_V:
            found = f"{self.gamma_1_per_V!r} beside beta = {self.beta_1_per_V!r}"
            raise ModelError(f"{ID}.gamma_1_per_V: found {found}, expected |gamma| <= beta: h grows without bound")


def constants(settings: Parameters, beam: "CompositeBeam | None") -> _Constants:
    """Return (r_k, p_k, q_k, c_k, s_1, s_2, s_3, alpha, beta, gamma, low, high, h, F_k).

    What the form does not use is empty or 0; beyond low and high curves run straight; h and F_k are those of the plays
    at rest.
    """
    del beam
    back = (
        settings.reversible_linear_um_per_V,
        settings.reversible_quadratic_um_per_V2,
        settings.reversible_cubic_um_per_V3,
    )
    ends = settings.straight_below_V, settings.straight_above_V
    if settings.form == "bouc_wen":
        loop = (settings.alpha_um_per_V, settings.beta_1_per_V, settings.gamma_1_per_V)
        return ((), (), (), (), *back, *loop, *ends, 0.0, ())
    none = (0.0,) * len(settings.thresholds_V)
    squares, cubes = settings.quadratic_um_per_V2 or none, settings.cubic_um_per_V3 or none
    many = settings.thresholds_V, settings.weights_um_per_V, squares, cubes
    plays = tuple(play(play(0.0, settings.reached_V, r), 0.0, r) for r in settings.thresholds_V)
    numbers = zip(plays, settings.weights_um_per_V, squares, cubes, strict=True)
    at_rest = sum(lagging(x, 0.0, p, q, c, *ends) for x, p, q, c in numbers)
    return (*many, *back, 0.0, 0.0, 0.0, *ends, at_rest, plays)


def initial(constants: _Constants) -> tuple[float, ...]:
    """Return (z, last v, then every play from where it rests) at rest."""
    return (0.0, 0.0) + (0.0,) * len(constants[0])


def corner(
    state: tuple[float, ...], constants: _Constants, h: float,
    w0: float, wm: float, w1: float, v0: float, vm: float, v1: float,
) -> float:  # fmt: skip
    """Return the fraction of the sub-step at which a play engages or the voltage turns, 1 for none."""
    del h, w0, wm, w1
    if v0 == vm == v1:
        return 1.0
    if len(constants[0]) > 0:
        first, low, high = passed(v0, vm, v1)
        for k in range(len(constants[0])):
            r = constants[0][k]
            first = engagement(play(state[2 + k] + constants[13][k], v0, r), r, first, low, high, v0, vm, v1)
        return first
    return turning_point(v0, vm, v1)


def reversible(v: float, s1: float, s2: float, s3: float, low: float, high: float) -> float:
    """Return the part that depends on the voltage alone, straight beyond both ends."""
    x = min(max(v, low), high)
    return v * (s1 + x * (s2 + x * s3))


def lagging(x: float, v: float, p: float, q: float, c: float, low: float, high: float) -> float:
    """Return what one play adds, x its output: p (x - v) + q (x^2 - v^2) + c (x^3 - v^3).

    Beyond both ends its weight is that at the end.
    """
    a = min(max(x, low), high)
    b = min(max(v, low), high)
    return (x - v) * (p + q * (a + b) + c * (a * a + a * b + b * b))


def beside(
    state: tuple[float, ...], constants: _Constants, time_s: float, h: float,
    w0: float, wm: float, w1: float, v0: float, vm: float, v1: float,
) -> tuple[tuple[float, ...], float, float, float]:  # fmt: skip
    """Add the hysteretic part, advanced along last voltage -> v0 -> vm -> v1."""
    del time_s, h
    thresholds, weights, squares, cubes, s1, s2, s3, alpha, beta, gamma, low, high, at_rest, begun = constants
    start = state[0] if v0 == state[1] else along(state[0], v0 - state[1], alpha, beta, gamma, 1.0)
    middle = end = start
    first = start - at_rest + reversible(v0, s1, s2, s3, low, high)
    second = third = first
    moves = not v0 == vm == v1
    if moves:
        middle = along(start, vm - v0, alpha, beta, gamma, 1.0)
        end = along(middle, v1 - vm, alpha, beta, gamma, 1.0)
        second = middle - at_rest + reversible(vm, s1, s2, s3, low, high)
        third = end - at_rest + reversible(v1, s1, s2, s3, low, high)
    after: list[float] = [end, v1]
    for k in range(len(thresholds)):
        r, p, q, c = thresholds[k], weights[k], squares[k], cubes[k]
        x0 = play(state[2 + k] + begun[k], v0, r)
        xm = x1 = x0
        y0 = ym = y1 = lagging(x0, v0, p, q, c, low, high)
        if moves:
            xm = play(x0, vm, r)
            x1 = play(xm, v1, r)
            ym = lagging(xm, vm, p, q, c, low, high)
            y1 = lagging(x1, v1, p, q, c, low, high)
        after.append(x1 - begun[k])
        first += y0
        second += ym
        third += y1
    return of_any_length(after), w0 + first, wm + second, w1 + third
