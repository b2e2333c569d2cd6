"""The numbers of a missing effect as its block bears them, with units, standard deviations and what is typical.

A form may search other numbers than its block has (a gain per half decade, the width of a loop). Its block's numbers
follow from those, and their deviations from the covariance of the search by the slopes of that map.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bender_discrepancy.conclusion.measurement.reading_units import length_power
from bender_effects.catalogue import EFFECTS, Effect
from bender_inference.fitting.hypothesis import Part
from bender_inference.fitting.output_error import Fitted
from bender_inference.fitting.profile import Ends
from bender_inference.fitting.uncertainty import moved
from bender_inference.records.observations import Array
from bender_plant.model import Model, ModelError
from bender_plant.parameter import meanings
from bender_report.number import Number
from bender_report.wording import HALF_WIDTH

# a value is called unusual when it is so by more than what chance may have added
CHANCE = 2.0
_HALVINGS = 30
"""So often the way to an end is halved beyond which a block takes no number."""


@dataclass(frozen=True, slots=True)
class Span:
    """What typical sizes scale with: the largest voltage of the records and the peak-to-peak of the readings.

    Of devices that are no piezo benders nothing is known to be typical.
    """

    full_voltage_V: float
    full_stroke_um: float
    piezo_bender: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class MovedGain:
    """A gain of the device, by which lengths become those of the reading.

    Attributes:
        factor: the gain.
        std: its standard deviation; inf or 0 where it is not to be counted.
        with_coordinates: (k,) its covariance with the coordinates of all free numbers.
    """

    factor: float
    std: float
    with_coordinates: Array

    def moved(self, told: Number, slopes: Array) -> Number:
        """Return a number in the unit of the reading.

        Args:
            told: as the effect has it, behind which the gain acts.
            slopes: (k,) of it by the coordinates.
        """
        power = length_power(told.unit)
        if power == 0:
            return told
        factor = self.factor**power
        value, std = factor * told.value, factor * told.std
        if 0.0 < told.std < math.inf and math.isfinite(self.std):
            by_gain = power * value / self.factor
            shared = np.where(slopes == 0.0, 0.0, self.with_coordinates)
            square = std**2 + (by_gain * self.std) ** 2 + 2.0 * factor * by_gain * float(slopes @ shared)
            std = math.sqrt(max(square, 0.0))
        if told.interval is None:
            return replace(told, value=value, std=std)
        wider = std / told.std if 0.0 < told.std < math.inf else factor
        low, high = (value + wider * (x - told.value) for x in told.interval)
        return replace(told, value=value, std=std, interval=(low, high))


def block_numbers(model: Model, block_id: str) -> dict[str, float]:
    """Return the numbers of one block of a model by name; those of a list are counted from 1."""
    settings = next(x.parameters for x in model.blocks if x.id == block_id)
    found: dict[str, float] = {}
    for name in meanings(settings):
        value = getattr(settings, name)
        if isinstance(value, tuple):
            found |= {f"{name}[{k + 1}]": float(x) for k, x in enumerate(value)}
        else:
            found[name] = float(value)
    return found


def form_of(model: Model, block_id: str) -> str | None:
    """Return the form that a block takes, None where it has but one."""
    settings = next(x.parameters for x in model.blocks if x.id == block_id)
    return getattr(settings, "form", None)


def _slopes(base: Model, part: Part, names: list[str]) -> Array:
    """Return the slopes of the block's numbers (rows) by the coordinates of the search (columns)."""
    slopes = np.zeros((len(names), len(part.values)))
    for k in range(len(part.values)):
        down, up, distance = moved(part.form.free, part.values, k)
        try:
            before = block_numbers(part.form.apply(base, tuple(down)), part.form.effect)
            after = block_numbers(part.form.apply(base, tuple(up)), part.form.effect)
        except ModelError:
            continue
        if distance:
            slopes[:, k] = [(after[name] - before[name]) / distance for name in names]
    return slopes


def _deviation(slopes: Array, covariance: Array) -> float:
    used = slopes != 0.0
    if not used.any():
        return 0.0
    if not np.all(np.isfinite(np.diag(covariance)[used])):
        return math.inf
    inner = covariance[np.ix_(used, used)]
    return math.sqrt(max(float(slopes[used] @ inner @ slopes[used]), 0.0))


def numbers(
    base: Model,
    fitted: Fitted,
    index: int,
    covariance: Array,
    span: Span,
    record: int = 0,
    ends: Sequence[Ends | None] = (),
    gain: MovedGain | None = None,
) -> tuple[Number, ...]:
    """Return the numbers of one effect of a hypothesis; what stays at its default is left out.

    Args:
        base: its linear structure.
        fitted: the hypothesis.
        index: which of its effects.
        covariance: (k, k) of the coordinates of all free numbers, see `uncertainty`.
        span: of the records, which typical sizes scale with.
        record: whose surroundings these are.
        ends: of the 95 % intervals of all free numbers; none for those of the covariance.
        gain: that acts behind the effect and belongs in front of it; None where it stays.
    """
    begin = sum(len(x.values) for x in fitted.hypothesis.parts[:index])
    part = fitted.hypothesis.alone(record).parts[index]
    if fitted.hypothesis.parts[index].form.records > 1:
        begin += record * len(part.values)
    own = slice(begin, begin + len(part.values))
    effect = EFFECTS[part.form.effect]
    found = block_numbers(part.form.apply(base, part.values), effect.id)
    names = list(found)
    slopes = _slopes(base, part, names)
    scales = np.array([free.log for free in part.form.free], dtype=bool)
    chosen = []
    for name, row in zip(names, slopes, strict=True):
        free = bool(np.any(row != 0.0))
        if free or effect.defaults.get(name, math.nan) != found[name]:
            is_scale = free and bool(np.all(scales[row != 0.0]))
            deviation = _deviation(row, covariance[own, own])
            told = number(effect, name, found[name], deviation, span, is_scale)
            moved_by = np.flatnonzero(row)
            if ends and moved_by.size == 1:
                told = _with_ends(base, part, told, int(moved_by[0]), ends[begin + int(moved_by[0])])
            if gain is not None:
                everything = np.zeros(gain.with_coordinates.size)
                everything[own] = row
                told = gain.moved(told, everything)
            chosen.append(told)
    return tuple(chosen)


def _with_ends(base: Model, part: Part, told: Number, k: int, ends: Ends | None) -> Number:
    """Return a number of the block with the interval of the one free number that moves it."""
    if ends is None:
        return told
    low, high = sorted(_at_end(base, part, told, k, x) for x in (ends.low, ends.high))
    return replace(told, interval=(low, high), profiled=ends.profiled)


def _at_end(base: Model, part: Part, told: Number, k: int, end: float) -> float:
    """Return a number of the block at an end of its interval, or next to it where the block takes no such number."""

    def at(share: float) -> float:
        values = (*part.values[:k], part.values[k] + share * (end - part.values[k]), *part.values[k + 1 :])
        return block_numbers(part.form.apply(base, values), part.form.effect)[told.name]

    taken, refused = 0.0, 1.0
    try:
        return at(1.0)
    except ModelError:
        for _ in range(_HALVINGS):
            middle = 0.5 * (taken + refused)
            try:
                at(middle)
                taken = middle
            except ModelError:
                refused = middle
    return at(taken)


def number(effect: Effect, name: str, value: float, std: float, span: Span, is_scale: bool) -> Number:
    """Return a number with what is typical of it; a scale may be unusually small as well, a size only too large."""
    field = name.partition("[")[0]
    typical = effect.typical_range(field, span.full_voltage_V, span.full_stroke_um) if span.piezo_bender else None
    unusual = False
    if typical is not None and 0.0 < std < math.inf:
        low, high = (x + sign * (CHANCE * std + _half_a_digit(x)) for x, sign in zip(typical, (-1.0, 1.0), strict=True))
        unusual = abs(value) > high or (is_scale and abs(value) < low)
    why = effect.typical[field][2] if typical is not None else ""
    within = (value - HALF_WIDTH * std, value + HALF_WIDTH * std) if 0.0 < std < math.inf else None
    return Number(name, value, effect.parameters[field].unit, std, typical, why, unusual, within)


def _half_a_digit(typical: float) -> float:
    """Return half of the second digit of a typical size: none is known more closely."""
    return 0.5 * 10.0 ** (math.floor(math.log10(typical)) - 1) if typical > 0.0 else 0.0
