"""What a search may put into a model: the form of an effect, and its free numbers."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from bender_plant.model import Model

Values = tuple[float, ...]

MOST_SHARE = 0.1
"""Of a lag: a second one of a larger share may as well be an effect of its own, on the other side of the plant."""
# beyond it a double overflows
MOST_EXPONENT = 700.0
AT_END = 1.01
"""Times a bound: a fit that is no further from it ended there."""
FAINTEST = 1e3
"""Times below the smallest size that is covered: how small an effect a search may find."""


@dataclass(frozen=True, slots=True)
class Free:
    """One free number of a form.

    Attributes:
        name: as the block names it, for the report.
        low: smallest value searched.
        high: largest value searched.
        log: search the logarithm.
        starts: values from which a search sets out; a single one for an amplitude, whose best value is solved for.
        unit: size of a small change, for numbers that are searched linearly.
        solved: the answer is nearly proportional to the number, whose best value a scan solves for.
        vanishes_at: value at which there is no effect, 0, 1 or infinity say. Where the residual is smaller than the
            effect at the nearest start, a scan adds starts that are closer to it. None adds no starts.
        jumps: the misfit falls in jumps, to which no slope leads.
        rings: rows on an even grid show it at its aliases as well: "Hz" where it is a frequency, "ratio" where it is
            one in units of the model's first mode, "factor" where that mode as given is at its only start; "delay"
            where whole periods of that mode look alike.
        no_answer_at: an end of its range, "low", "high" or "both", at which a fit found no such effect, but the part of
            another one that it can stand in for.
    """

    name: str
    low: float
    high: float
    log: bool
    starts: Values
    unit: float = 1.0
    solved: bool = False
    vanishes_at: float | None = None
    jumps: bool = False
    rings: str = ""
    no_answer_at: Literal["", "low", "high", "both"] = ""

    def ends_without_answer(self, value: float) -> bool:
        """Return whether a fit ended where it is no answer."""
        at_low, at_high = self._at_ends(value)
        return (at_low and self.no_answer_at in ("low", "both")) or (at_high and self.no_answer_at in ("high", "both"))

    def is_at_end(self, value: float) -> bool:
        """Return whether a value is at an end of the range, beyond which nothing was sought."""
        return any(self._at_ends(value))

    @property
    def is_size(self) -> bool:
        """Whether the number says how much of the effect there is."""
        return self.solved or self.vanishes_at is not None

    def may_vanish(self, value: float, low: float, high: float) -> bool:
        """Return whether an interval of a size holds none of the effect at all.

        A logarithm never reaches none: there the interval of the size itself does, whose parabola has the same end.

        Args:
            value: the size.
            low: end of its interval.
            high: end of its interval.
        """
        nothing = 0.0 if self.vanishes_at is None else self.vanishes_at
        if self.log and nothing <= self.low:
            return low * math.e <= value
        if self.log and nothing >= self.high:
            return high >= value * math.e
        return low <= nothing <= high

    def _at_ends(self, value: float) -> tuple[bool, bool]:
        at_low = value <= self.low * AT_END if self.low > 0.0 else value * AT_END <= self.low < 0.0
        return at_low, value * AT_END >= self.high

    def times(self, factor: float) -> "Free":
        """Return the number for signals that are larger by a factor."""
        starts = tuple(factor * x for x in self.starts)
        return replace(self, low=factor * self.low, high=factor * self.high, starts=starts, unit=factor * self.unit)

    def reaching(self, low: float, high: float) -> "Free":
        """Return the number with bounds that hold sizes from `low` to `high`, of either sign where it has both."""
        return replace(self, low=min(self.low, low if self.low >= 0.0 else -high), high=max(self.high, high))

    def inward(self, value: float) -> float:
        """Return the coordinate of a value: its logarithm, or the value in units."""
        return math.log(value) if self.log else value / self.unit

    def outward(self, coordinate: float) -> float:
        """Return the value at a coordinate, kept within the bounds."""
        value = math.exp(min(coordinate, MOST_EXPONENT)) if self.log else coordinate * self.unit
        return min(max(value, self.low), self.high)


@dataclass(frozen=True, slots=True)
class Form:
    """One form of one effect.

    Attributes:
        effect: the contract's id.
        name: of the form, unique.
        free: its free numbers.
        apply: puts the block into a model, given the free numbers.
        memory: its output depends on the past of the input: one frequency at one amplitude cannot tell it.
        timed: its name needs true times.
        adds_up: its output adds up what goes in, without end.
        records: of how many records it has numbers; those of the first one come first. One set serves all where 1.
        shown: another channel of the records shows the effect: it stands, whatever the readings alone would say.
        refines: the name of a form of the same effect that has the first of these numbers only: a search sets out from
            where that one promises most.
        beside: id of the effect that it also is, besides its own: a loop beside a curve.
        curve: the free numbers of what it is beside.
        scan: how its starts are found: "delay", "steps", "swing", "ring", "limit above" or "limit
            below"; "" for those that its numbers have.
    """

    effect: str
    name: str
    free: tuple[Free, ...]
    apply: Callable[[Model, Values], Model]
    memory: bool = False
    timed: bool = True
    records: int = 1
    shown: bool = False
    refines: str = ""
    beside: str = ""
    curve: tuple[str, ...] = ()
    scan: str = ""
    adds_up: bool = False

    def of_record(self, values: Values, record: int) -> Values:
        """Return the numbers that hold for one record."""
        if self.records == 1:
            return values
        size = len(self.free) // self.records
        return values[record * size : (record + 1) * size]

    def holding(self, name: str, value: float) -> "Form":
        """Return the form with one of its free numbers, where it has that, held at a value."""
        places = [k for k, free in enumerate(self.free) if free.name == name]
        if not places:
            return self
        k, apply = places[0], self.apply

        def held(model: Model, values: Values) -> Model:
            return apply(model, (*values[:k], value, *values[k:]))

        return replace(self, free=(*self.free[:k], *self.free[k + 1 :]), apply=held)

    def curve_alone(self, values: Values) -> tuple["Form", Values]:
        """Return what the form is beside, without the form's own effect, and the numbers of that.

        Its own sizes are held at none, its other numbers where they are.
        """
        found = replace(self, name=f"{self.name}, the curve alone")
        for free, value in zip(self.free, values, strict=True):
            if free.name not in self.curve:
                found = found.holding(free.name, 0.0 if free.is_size else value)
        return found, tuple(v for free, v in zip(self.free, values, strict=True) if free.name in self.curve)

    def setting_out_from(self, promising: Sequence[Values]) -> "Form":
        """Return the form with its first numbers searched from those values only."""
        free = list(self.free)
        for k, own in enumerate(zip(*promising, strict=True)):
            free[k] = replace(free[k], starts=tuple(dict.fromkeys(own)))
        return replace(self, free=tuple(free))

    def alone(self) -> "Form":
        """Return the form for one record."""
        return replace(self, free=self.free[: len(self.free) // self.records], records=1)

    def for_each_of(self, records: int) -> "Form":
        """Return the form with numbers of their own for so many records, as surroundings have."""
        return replace(self, free=self.free * records, records=records)


def scale(name: str, low: float, high: float, count: int, vanishes_at: float | None = None) -> Free:
    """Return a free scale with starts spread evenly over its decades; its bounds reach towards `vanishes_at`."""
    starts = np.geomspace(low, high, count)
    least = low / (FAINTEST if vanishes_at == 0.0 else 2.0)
    most = high * (FAINTEST if vanishes_at == math.inf else 2.0)
    return Free(name, least, most, True, tuple(float(x) for x in starts), vanishes_at=vanishes_at)


def time_constant(low_s: float, high_s: float, per_decade: float = 2.4) -> Free:
    """Return a free time constant with so many starts in every decade; the shorter it is, the less it does."""
    return scale("time_constant_s", low_s, high_s, 1 + round(per_decade * math.log10(high_s / low_s)), 0.0)


def amplitude(name: str, unit_size: float, limit: float) -> Free:
    """Return a free amplitude of either sign; `unit_size` is what a first small trial uses."""
    return Free(name, -limit, limit, False, (unit_size,), unit_size, solved=True)


def growth(name: str, unit_size: float, limit: float) -> Free:
    """Return a free amplitude that is not negative: what is passive creeps on with a step and leaks against it."""
    return replace(amplitude(name, unit_size, limit), low=0.0)


def simple(
    effect: str,
    *free: Free,
    memory: bool = False,
    timed: bool = True,
    name: str = "",
    refines: str = "",
    scan: str = "",
) -> Form:
    """Return a form whose free numbers are parameters of the block, by their names."""
    names = [x.name for x in free]

    def apply(model: Model, values: Values) -> Model:
        return model.with_block(effect, **dict(zip(names, values, strict=True)))

    return Form(effect, name or effect, free, apply, memory, timed, refines=refines, scan=scan)


def monotone(effect: str, size: Free, duration_s: float) -> tuple[Form, ...]:
    """Return the forms of what changes with time alone, one way, with one time constant or a stretched one.

    What is over, three time constants, within a tenth of the record belongs to its beginning.
    """
    starts = tuple(duration_s * x for x in (0.05, 0.1, 0.3, 1.0, 10.0))
    tau = Free("time_constant_s", duration_s / 30.0, 100.0 * duration_s, True, starts, no_answer_at="low")
    stretch = Free("exponent", 0.3, 4.0, True, (0.5, 2.0), no_answer_at="both")
    return simple(effect, size, tau), simple(effect, size, tau, stretch, name=f"{effect}, stretched")


def lag_of_two(plain: Form) -> Form:
    """Return the form of a lag with a second one behind it, `second_share` of its time constant."""
    share = Free("second_share", 1e-4, MOST_SHARE, True, (0.003, 0.03))
    return simple(plain.effect, *plain.free, share, memory=True, name=f"{plain.name}, of two", refines=plain.name)
