"""What the optional channels of all records testify together, and what is said of it.

The read-back voltage stands between what lies before the supply's terminals and what lies behind them. What it shows
is there, and is sought first; where it follows the command, an effect before it can only be as large as it leaves
room for. A resistance between the terminals and the electrodes lags without showing there; a voltage that was measured
at the electrodes excludes that lag as well. The current shows a supply at its limit, where the voltage was not read
back. The temperature does the same for what drifts.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from bender_effects.catalogue import EFFECTS
from bender_effects.form import Form, Free
from bender_inference.fitting.criterion import CONFIDENCE
from bender_inference.witnesses.ammeter import slew_range_V_per_s
from bender_inference.witnesses.read_back import ELECTRODES, SUPPLY, read_back
from bender_inference.witnesses.terminals import (
    BEFORE_ELECTRODES,
    BEFORE_TERMINALS,
    ROOM,
    WITNESSED,
    Terminals,
    judge_voltages,
)
from bender_inference.witnesses.thermometer import MOST_UM_PER_K, SLOWEST, WARM_K, Course, course_of
from bender_loop.records.record import Record
from bender_report.wording import listed, quantity

LEAST_UM = 1e-6
"""A drift of one record whose temperature stays while that of another changes."""
INF = math.inf
_TOLD = {name: x.witnessed for name, x in EFFECTS.items() if x.witnessed is not None}
WARMED = tuple(name for name, x in _TOLD.items() if x.by_temperature)
LIMITED = tuple(name for name, x in _TOLD.items() if x.by_current)
"""Effects that a temperature shows, and those that a current shows which stays at its limit."""
PLACES: Mapping[str, tuple[str, tuple[str, ...]]] = {
    SUPPLY: ("the supply's read-back voltage", BEFORE_TERMINALS),
    ELECTRODES: ("the voltage at the electrodes", BEFORE_ELECTRODES),
}
"""Where a voltage is read, in words, and the effects that lie nowhere but before that place."""
Limits = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Witnesses:
    """What the channels of all records leave of each effect, and show.

    Attributes:
        supply: ends of the number of each effect before the terminals, by the effect's id; none is left where the first
            is above the second.
        shown: ids of the effects of which the read-backs show one, and the values of their numbers.
        courses: of the temperature, of every record; None for one without.
        is_film: the plant is a film whose tip is known to move with the temperature.
        sentences: what was testified, for the report.
    """

    supply: Limits = field(default_factory=dict)
    shown: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    courses: tuple[Course | None, ...] = ()
    is_film: bool = True
    sentences: tuple[str, ...] = ()

    def left(self, forms: Sequence[Form]) -> tuple[Form, ...]:
        """Return the forms that no witness contradicts, with the numbers that the witnesses leave them."""
        return tuple(form for x in forms if (form := self.of_form(x)) is not None)

    def of_form(self, form: Form) -> Form | None:
        """Return a form with the numbers that the channels leave it; None where they contradict all of them."""
        if form.effect in WARMED:
            return self._of_drift(form)
        if form.effect not in self.supply or not form.free:
            return form
        low, high = self.supply[form.effect]
        values = self.shown.get(form.effect, ())
        if not form.free[0].log:  # a delay is told by the tip better than by rows
            return replace(form, shown=bool(values))
        free = _within(form.free[0], low, high, values)
        if free.low >= free.high:
            return None
        return replace(form, free=(free, *form.free[1:]), shown=bool(values))

    def first(self, forms: Sequence[Form]) -> tuple[tuple[Form, ...], ...]:
        """Return forms of which one each is sought before all others, since a witness shows it."""
        supply = tuple(x for x in forms if x.shown)
        warm = tuple(x for x in forms if x.effect in WARMED and self.is_film and any(self._warms))
        return tuple(x for x in (supply, warm) if x)

    @property
    def _warms(self) -> list[bool]:
        return [x is not None and x.is_shown for x in self.courses]

    def _of_drift(self, form: Form) -> Form | None:
        if not self.is_film:
            still = bool(self.courses) and all(x is not None and x.range_K <= WARM_K for x in self.courses)
            return None if still else form
        if self.courses and all(x is not None and x.most_K == 0.0 for x in self.courses):
            return None
        if form.records not in (1, len(self.courses)):
            return form
        size = len(form.free) // form.records
        free: list[Free] = []
        for k in range(form.records):
            course = self.courses[k] if self.courses else None
            free += [_of_course(x, course) for x in form.free[k * size : (k + 1) * size]]
        return replace(form, free=tuple(free))


def judge_channels(
    records: Sequence[Record],
    forms: Sequence[Form],
    *,
    is_film: bool,
    linear: bool = False,
    confidence: float = CONFIDENCE,
) -> Witnesses:
    """Return what the channels of the records of one bench testify together.

    Args:
        records: of one bench.
        forms: of the effects that are sought.
        is_film: the plant is a film of PVDF, of which is known how far a kelvin moves it.
        linear: commands run straight from row to row.
        confidence: of what is said.
    """
    supply: dict[str, tuple[float, float]] = {}
    shown: dict[str, tuple[float, ...]] = {}
    said: list[str] = []
    for column, (place, only_before) in PLACES.items():
        read = [x for one in records if (x := read_back(one, linear, column)) is not None]
        found = judge_voltages(read, forms, confidence, only_before)
        if shown and found.shown:  # the terminals say which effect it is that the electrodes show as well
            continue
        left = _left_by(found)
        said += _of_supply(place, found, left)
        supply = _both(supply, left)
        shown |= {x.effect: x.values for x in found.shown}
    courses = tuple(course_of(x, confidence) for x in records)
    said += _of_warmth(courses, is_film)
    limit_V_per_s = None if shown else _limited(records, supply)
    if limit_V_per_s is not None:
        low, high = limit_V_per_s
        supply |= dict.fromkeys(LIMITED, (low / ROOM, high * ROOM))
        shown |= dict.fromkeys(LIMITED, (math.sqrt(low * high),))
        said.insert(0, _of_limit(limit_V_per_s))
    return Witnesses(supply, shown, courses, is_film, tuple(said))


def _left_by(found: Terminals) -> dict[str, tuple[float, float]]:
    """Return the ends of the number of each effect that read-backs of one place leave."""
    bound = {effect: (low, high) for effect, low, high in found.limits}
    return bound | {x.effect: (x.low, x.high) for x in found.shown}


def _both(first: Limits, second: Limits) -> dict[str, tuple[float, float]]:
    """Return what two places leave together."""
    ends = {x: (first.get(x, (0.0, INF)), second.get(x, (0.0, INF))) for x in (*first, *second)}
    return {x: (max(a[0], b[0]), min(a[1], b[1])) for x, (a, b) in ends.items()}


def _limited(records: Sequence[Record], supply: Limits) -> tuple[float, float] | None:
    """Return the slew rates that the currents show, None where they show none that the read-back voltage admits."""
    found = slew_range_V_per_s(records)
    least = min(supply.get(x, (0.0, INF))[0] for x in LIMITED)
    return found if found is not None and found[1] > least else None


def _within(free: Free, low: float, high: float, told: tuple[float, ...] = ()) -> Free:
    least, most = max(free.low, low), min(free.high, high)
    starts = tuple(x for x in free.starts if least <= x <= most)
    if free.starts and not starts and 0.0 < least < most:
        starts = (math.sqrt(least * most),)
    return replace(free, low=least, high=most, starts=(*told, *starts))


def _of_course(free: Free, course: Course | None) -> Free:
    """Return a number of a drift as the course of the temperature leaves it."""
    if course is None:
        return free
    if free.name == "amplitude_um":
        reached = -math.expm1(-1.0 / SLOWEST) if not course.is_shown else 1.0
        most = max(MOST_UM_PER_K * course.most_K / reached, LEAST_UM)
        starts = tuple(math.copysign(min(abs(x), 0.5 * most), x) for x in free.starts)
        return replace(free, low=max(free.low, -most), high=min(free.high, most), starts=starts)
    if free.name == "time_constant_s" and not course.is_shown:
        return _within(free, free.low, SLOWEST * course.tau_s)
    return free


def _of_supply(place: str, found: Terminals, supply: Limits) -> list[str]:
    if found.shown:
        names = listed([x.effect for x in found.shown], "or")
        others = [x for x, (low, high) in supply.items() if low >= high]
        beside = f", which excludes {listed(others)} beside it" if others else ""
        return [f"witness: {place} shows {names}{beside}"]
    told = [_excluded(effect, *supply[effect]) for effect in WITNESSED if effect in supply]
    told = [x for x in told if x]
    if not told:
        return []
    return [f"witness: {place} follows the command, which excludes {', '.join(told)}"]


def _excluded(effect: str, low: float, high: float) -> str:
    """Return what a bound excludes of an effect, in words; "" where a voltage that follows bounds nothing."""
    witnessed = WITNESSED[effect]
    if not witnessed.excludes:
        return ""
    unit = next(iter(EFFECTS[effect].parameters.values())).unit
    return f"{witnessed.bound} {quantity(low if witnessed.excludes == 'below' else high, unit, 2)}"


def _of_limit(rates_V_per_s: tuple[float, float]) -> str:
    low, high = (quantity(x, "V/s", 2) for x in rates_V_per_s)
    names = listed(LIMITED, "or")
    return f"witness: the supply's current stays at its limit after steps, as at a {names} of {low} to {high}"


def _of_warmth(courses: Sequence[Course | None], is_film: bool) -> list[str]:
    known = [x for x in courses if x is not None]
    if not known or len(known) < len(courses):
        return []
    if any(x.is_shown for x in known):
        widest = max((x.change_K for x in known), key=abs)
        return [f"witness: the temperature changes by {quantity(widest, 'K', 2)}, one way, as thermal_drift would"]
    if not is_film:
        if max(x.range_K for x in known) > WARM_K:
            return []
        return [f"witness: the temperature stays within {WARM_K:g} K, which excludes thermal_drift"]
    most_K = max(x.most_K for x in known)
    if most_K == 0.0:
        return ["witness: the temperature is constant, which excludes thermal_drift"]
    moved = quantity(MOST_UM_PER_K * most_K, "um", 2)
    changed = quantity(most_K, "K", 2)
    return [f"witness: the temperature changes by no more than {changed}, which excludes a thermal_drift above {moved}"]
