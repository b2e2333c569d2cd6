"""The smallest size of every effect that the records would have shown, beside what was found.

An effect of size s would have changed the readings by c(s). What the numbers of the hypothesis that stands could take
over of that is projected out (Frisch, Waugh and Lovell), and the rest must pass every test that a further effect
passes: its innovations what the criterion asks for, its mean square what is more than small and no mopping up
(`evidence`). The smallest such s is told, at those of the other numbers of its form at which the effect shows most. An
effect that is in the hypothesis is taken out first. Whether a record that shows an effect tells it from its rivals as
well is another question: that is what rivals and the next experiment are for.
"""

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from bender_compiled.parallel_map import parallel_map
from bender_discrepancy.conclusion.numbers import block_numbers
from bender_effects.catalogue import EFFECTS, READ_OFF
from bender_effects.effect import CALIBRATION
from bender_effects.form import Form, Free, Values
from bender_inference.fitting.criterion import innovations_square, price
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.own_numbers import own_form, own_numbers
from bender_inference.fitting.uncertainty import columns
from bender_inference.records.observations import Array
from bender_inference.search.judgement.rules import above_floor_um2
from bender_inference.search.noise import floor_limit, floor_square_um2
from bender_inference.search.result import SearchResult

TURNS, NEAR = 8, 0.5
"""Of the search for a size: where the logarithm of the energy is so near to what is asked for, one step leads there."""
MOST_FURTHER = 5
"""Values that are tried of a number whose form gives no starts."""
LINEAR, LEAST_POWER, MOST_POWER = 2.0, 0.5, 4.0
"""Of the growth of the energy with the size: where readings change in proportion to it, to its root, to its square."""
NUDGE = 1e-3
LEAST = 1e-9
"""A direction that is weaker than this beside the strongest one is rounding."""
MOST_EXPONENT = 700.0
FINEST = 1e-12
"""Of the largest size: what is smaller counts as nothing."""


@dataclass(frozen=True, slots=True)
class Smallest:
    """The smallest size of one effect that the records would have shown.

    Attributes:
        parameter: of its block, by which it is sized; `name[k]` for one of a list.
        value: in its unit; None where they would show it at no size that is searched, or where simulations are too
            coarse to say.
        unit: "1" where it has none.
        beside: the other numbers of its form, at which it shows most: name, value and unit.
        below: the effect is the larger, the smaller the parameter is, as with a slew rate: what is below shows.
        further: the model has the effect already; the value is by how much it would have to be larger.
    """

    parameter: str
    value: float | None
    unit: str
    beside: tuple[tuple[str, float, str], ...] = ()
    below: bool = False
    further: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of `diagnosis.json`."""
        at = {name: {"value": value, "unit": unit} for name, value, unit in self.beside}
        shown = "below" if self.below else "above"
        entry = {"parameter": self.parameter, "value": self.value, "unit": self.unit, "shown": shown}
        return entry | ({"at": at} if at else {}) | ({"further": True} if self.further else {})


def smallest_visible(search: SearchResult) -> dict[str, Smallest]:
    """Return the smallest visible size of every effect that was sought, by the effect's id, in the catalogue's order.

    Of one that the model has already, it is the smallest by which it would have to be larger.

    Args:
        search: what was found in the records.
    """
    plainest: dict[str, Form] = {}
    for form in search.candidates:
        known = plainest.get(form.effect)
        if known is None or len(form.free) < len(known.free):
            plainest[form.effect] = form
    found_there = set(search.best.hypothesis.effects)
    beside = _standing(search)

    def smallest(form: Form) -> Smallest:
        try:
            return _smallest(search, form, _standing(search, form.effect) if form.effect in found_there else beside)
        finally:
            # what the simulations of one effect begin with helps no other one, and is memory
            for simulator in search.problem.rough:
                simulator.forget()

    sizes = parallel_map(smallest, list(plainest.values()))
    found = _further_than_own(search, beside) | dict(zip(plainest, sizes, strict=True)) | _read_off(search)
    return {name: found[name] for name in EFFECTS if name in found}


def _further_than_own(search: SearchResult, beside: "_Standing | None") -> dict[str, Smallest]:
    """Return by how much more an effect would have to be that the model has already, where it was not fitted again."""
    form, fitted = own_form(search.base), search.best.hypothesis.own
    freed = () if fitted is None else tuple(x.name for x in fitted.form.free)
    found: dict[str, Smallest] = {}
    for x in own_numbers(search.base):
        if form is None or x.block not in EFFECTS or x.name in freed:
            continue
        further = form
        for other in form.free:
            further = further if other.name == x.name else further.holding(other.name, other.starts[0])
        free = replace(further.free[0], low=x.given, log=False, starts=(), vanishes_at=x.given)
        further = replace(further, free=(free,))
        size = None if beside is None else _size(beside, further, ())
        unit = EFFECTS[x.block].parameters[x.parameter].unit
        found[x.block] = Smallest(x.parameter, None if size is None else size[0], unit, further=True)
    return found


def _read_off(search: SearchResult) -> dict[str, Smallest]:
    """Return the sizes of what is read off the record or solved for: they matter beside the noise."""
    matters = search.rules.matters * search.archive.noise_um
    readings = [x.measured_um[x.searched] for x in search.problem.observations]
    spread = math.sqrt(float(np.mean(np.concatenate([y - y.mean() for y in readings]) ** 2)))
    calibrated = {name: next(iter(x.parameters)) for name, x in EFFECTS.items() if x.stage == CALIBRATION}
    relative = 1.0 + matters / spread if spread > 0.0 else None
    sizes = {name: relative if number == "gain" else matters for name, number in calibrated.items()}
    sizes |= {READ_OFF: math.sqrt(12.0) * matters}
    units = {name: next(iter(EFFECTS[name].parameters.items())) for name in sizes}
    return {name: Smallest(units[name][0], size, units[name][1].unit) for name, size in sizes.items()}


@dataclass(frozen=True, slots=True, eq=False)
class _Standing:
    """The hypothesis that an effect stands beside, and what the effect is held to.

    Attributes:
        search: what was found.
        hypothesis: all but the effect itself.
        before: readings of it, (n,) of all records, by rough simulations.
        plain, white: what projects out the numbers of it, on rows that count and of innovations.
        asked: the sum of squares that a further effect must leave on the rows.
    """

    search: SearchResult
    hypothesis: Hypothesis
    before: Array
    plain: Array
    white: Array
    asked: float

    def ratio(self, form: Form, values: Values) -> float:
        """Return the energy that an effect leaves over what is asked for, the smaller of two; nan where it cannot be.

        Args:
            form: of the effect.
            values: of its numbers.
        """
        readings = self.search.problem.readings(self.hypothesis.plus(form, values), roughly=True)
        if readings is None:
            return math.nan
        change = self.search.best.calibration.gain * (np.concatenate(readings) - self.before)[:, None]
        plain, white = _counted(self.search, change)[:, 0], _innovations(self.search, change)[:, 0]
        asked = _asked_of_innovations(self.search, len(form.free))
        sizes = _beyond(self.plain, plain) / max(self.asked, 1e-300), _beyond(self.white, white) / max(asked, 1e-300)
        return min(sizes)


def _standing(search: SearchResult, effect: str = "") -> _Standing | None:
    """Return what an effect stands beside: all that was found but itself; None where that cannot be simulated."""
    problem, best = search.problem, search.best
    index = next((k for k, x in enumerate(best.hypothesis.parts) if x.form.effect == effect), None)
    rest = best.hypothesis if index is None else best.hypothesis.minus(index)
    fine, rough = problem.readings(rest), problem.readings(rest, roughly=True)
    if fine is None or rough is None:
        return None
    whole = [np.ones(x.usable.size, dtype=np.bool_) for x in problem.observations]
    slopes = columns(problem, replace(best, hypothesis=rest), fine, whole)
    asked = problem.all_rows * _asked_um2(search)
    plain, white = _basis(_counted(search, slopes)), _basis(_innovations(search, slopes))
    return _Standing(search, rest, np.concatenate(rough), plain, white, asked)


def _asked_um2(search: SearchResult) -> float:
    """Return the mean square that a further effect has to add to the residual before it is sought and kept.

    It solves the tests of `search.rules` for that energy: `is_finished` says when an effect is sought, `is_material`
    when it removes more than the form of another one may have missed.
    """
    problem, rules, archive = search.problem, search.rules, search.archive
    floor = floor_square_um2(problem, archive.noise_um)
    limit = min(floor_limit(problem, rules.confidence, judged=x) for x in (True, False))
    rest, gap = above_floor_um2(archive, search.best), above_floor_um2(archive, search.found.base)
    left = rest + floor
    if not search.best.hypothesis.parts:
        return max(limit * floor - left, 0.0)
    not_closed = ((1.0 - rules.closes) * gap - rest) / rules.closes
    sought = min((1.0 + rules.at_noise) * floor - left, max(limit * floor - left, not_closed))
    part = rules.remainder * rest / (1.0 - rules.remainder)
    return max(sought, min(part, rules.inadequacy * gap / (1.0 - rules.inadequacy)), 0.0)


def _asked_of_innovations(search: SearchResult, more: int) -> float:
    """Return the sum of squares of innovations that pays for so many more numbers and passes the threshold."""
    by, count = search.grades.by, search.best.hypothesis.free_count
    dearer = price(count + more, by.effective_rows) - price(count, by.effective_rows) + by.threshold
    exponent = dearer / by.effective_rows
    return innovations_square(search.best, by) * math.expm1(exponent) if exponent < MOST_EXPONENT else math.inf


def _split(search: SearchResult, columns: Array) -> list[Array]:
    ends = np.cumsum([x.usable.size for x in search.problem.observations])[:-1]
    return np.split(columns, ends)


def _counted(search: SearchResult, columns: Array) -> Array:
    """Return columns (n, k) of all rows on those that fits and choices see."""
    rows = zip(_split(search, columns), search.problem.observations, strict=True)
    return np.concatenate([part[x.searched] for part, x in rows])


def _innovations(search: SearchResult, columns: Array) -> Array:
    """Return the innovations of columns (n, k), through the filters of the hypothesis that stands."""
    if not search.grades.by.filters:
        return _counted(search, columns)
    parts = zip(_split(search, columns), search.grades.by.filters, strict=True)
    return np.concatenate([np.stack([by.innovations(y) for y in part.T], axis=1) for part, by in parts])


def _basis(columns: Array) -> Array:
    sizes = np.linalg.norm(columns, axis=0)
    left, strength, _ = np.linalg.svd(columns[:, sizes > 0.0] / sizes[sizes > 0.0], full_matrices=False)
    return left[:, strength > LEAST * strength[0]] if strength.size else left


def _beyond(basis: Array, change: Array) -> float:
    left = change - basis @ (basis.T @ change)
    return float(left @ left)


@dataclass(frozen=True, slots=True)
class _Scale:
    """The first number of a form by its distance from where there is no effect; `inverse` where that is at infinity."""

    free: Free
    inverse: bool

    def value(self, distance: float) -> float:
        """Return the number at a distance, within its bounds."""
        found = 1.0 / distance if self.inverse else (self.free.vanishes_at or 0.0) + distance
        return min(max(found, self.free.low), self.free.high)

    def distance(self, value: float) -> float:
        """Return the distance of a number."""
        return 1.0 / value if self.inverse else value - (self.free.vanishes_at or 0.0)

    @property
    def largest(self) -> float:
        """The largest distance that is searched."""
        return self.distance(self.free.low if self.inverse else self.free.high)


def _scale(seen: _Standing, form: Form, others: Values) -> _Scale:
    """Return the first number as a distance; where nothing says at which end it vanishes, the readings do."""
    free = form.free[0]
    inverse = free.vanishes_at == math.inf
    if free.log and free.vanishes_at is None:
        low, high = (seen.ratio(form, _values(form, x, others)) for x in (free.low, free.high))
        inverse = low > high
    return _Scale(free, inverse)


def _values(form: Form, first: float, others: Values) -> Values:
    """Return the numbers of a form for all records: the first one, then the others."""
    return (first, *others) * form.records


def _others(free: Free, seen: _Standing) -> Values:
    """Return the values at which one of the further numbers is tried: its starts, or some over what the rows show."""
    if free.solved:
        return (0.0,)
    if free.starts:
        return free.starts
    rows_s = max(float(np.median(np.diff(x.time_s))) for x in seen.search.problem.observations)
    return tuple(float(x) for x in np.geomspace(free.low, min(free.high, 0.5 / rows_s), MOST_FURTHER + 2)[1:-1])


def _smallest(search: SearchResult, form: Form, seen: _Standing | None) -> Smallest:
    """Return the smallest visible size of one effect in one form."""
    found = None if seen is None else _size(seen, form, _where_it_shows_most(seen, form))
    return _smallest_in_numbers(search, form, *(found[1:] if found else (None, False)))


def _where_it_shows_most(seen: _Standing, form: Form) -> Values:
    """Return those of the other numbers at which an effect of one size leaves most."""
    first, *further = form.alone().free
    size = first.starts[0] if first.starts else first.high
    tried = list(product(*(_others(x, seen) for x in further)))
    if len(tried) == 1:
        return tried[0]
    ratios = [seen.ratio(form, _values(form, size, x)) for x in tried]
    return tried[int(np.nanargmax(ratios))] if np.isfinite(ratios).any() else tried[0]


def _size(seen: _Standing, form: Form, others: Values) -> tuple[float, Values, bool] | None:
    """Return the smallest visible distance, all numbers there, and whether smaller ones show; None where none shows."""
    scale = _scale(seen, form, others)
    near = min((abs(scale.distance(x)) for x in scale.free.starts if scale.distance(x)), default=scale.largest)
    least = FINEST * scale.largest
    if not least > 0.0:
        # already beyond where the effect would be sought
        return None
    distance, power, last = max(near, least), LINEAR, (0.0, 0.0)
    for turn in range(TURNS):
        ratio = seen.ratio(form, _values(form, scale.value(distance), others))
        if not ratio > 0.0:
            return None
        at = math.log(distance), min(math.log(ratio), MOST_EXPONENT)
        if distance == scale.largest and at[1] < 0.0:
            return None
        if scale.value(distance) == scale.value(least) and at[1] > 0.0:
            # what is next to nothing cannot show: here simulations of other sub-steps differ by more
            return None
        if turn and at[0] != last[0]:
            power = min(max((at[1] - last[1]) / (at[0] - last[0]), LEAST_POWER), MOST_POWER)
        last = at
        distance = min(max(distance * math.exp(-at[1] / power), least), scale.largest)
        if abs(at[1]) < NEAR:
            return distance, (scale.value(distance), *others), scale.inverse
    return None


def _smallest_in_numbers(search: SearchResult, form: Form, values: Values | None, below: bool) -> Smallest:
    """Return the numbers of the effect's block, the one by which it is sized first."""
    parameters = EFFECTS[form.effect].parameters
    one = form.alone().free
    known = values or tuple(x.starts[0] if x.starts else x.high for x in one)
    numbers = block_numbers(form.apply(search.base, known), form.effect)
    nudged = form.apply(search.base, (one[0].outward(one[0].inward(known[0]) + NUDGE), *known[1:]))
    moved = [name for name, x in block_numbers(nudged, form.effect).items() if x != numbers[name]]
    first, *further = moved or list(numbers)
    given = EFFECTS[form.effect].defaults
    beside = [name for name in numbers if name != first and (name in further or given.get(name) != numbers[name])]
    units = {name: parameters[name.partition("[")[0]].unit for name in numbers}
    if values is None:
        return Smallest(first, None, units[first])
    return Smallest(first, numbers[first], units[first], tuple((x, numbers[x], units[x]) for x in beside), below)
