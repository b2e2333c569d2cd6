"""What may change in a hypothesis: each move is a small function from a fitted hypothesis to what is worth fitting.

A move knows no effect by its id. What is special about one stands in its own file of the catalogue.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bender_effects.catalogue import EFFECTS
from bender_effects.form import Form
from bender_inference.fitting.hypothesis import Hypothesis, Part
from bender_inference.fitting.output_error import Fitted
from bender_inference.fitting.own_numbers import (
    changes_as_effects,
    effects_of,
    first_mode_Hz,
    names_of,
    part_without_named,
)
from bender_inference.records.spectrum import are_even
from bender_inference.search.archive import Archive
from bender_plant.model import Model

ALIASES = 12
RINGS = (-2, -1, 1, 2)
"""Periods of the first mode by which a delay is tried elsewhere."""
SPLITS = (0.1, 0.5, 0.9)
"""Parts of a delay that the first of two lags sets out with."""


@dataclass(frozen=True, slots=True)
class Scan:
    """Forms to be scanned on a fitted hypothesis: each promises what a fit may leave."""

    parent: Fitted
    forms: tuple[Form, ...]


@dataclass(frozen=True, slots=True)
class Start:
    """A hypothesis to be fitted from where it stands."""

    hypothesis: Hypothesis


@dataclass(frozen=True, slots=True, eq=False)
class Kit:
    """What a search may put into one linear structure.

    Attributes:
        structure: the linear model; None for the model as given.
        forms: of the effects.
        own: frees the model's own linear numbers; None where it has none but gain and offset.
        hidden: the structure's numbers show beside an effect only: alone, they are not freed.
    """

    structure: Model | None
    forms: tuple[Form, ...]
    own: Form | None = None
    hidden: bool = False

    def without_changes_of_numbers(self) -> "Kit":
        """Return the kit without effects that are a change of the structure's own numbers."""
        return replace(self, forms=tuple(x for x in self.forms if x.effect not in effects_of(self.own)))

    def of(self, effect: str) -> tuple[Form, ...]:
        """Return the forms of an effect."""
        return tuple(x for x in self.forms if x.effect == effect)


@dataclass(frozen=True, slots=True, eq=False)
class Catalogue:
    """What a search may choose from.

    Attributes:
        kits: for each linear structure, the model as given alone or several that compete.
        shown: forms of which one each is sought before all others: what a witness shows.
        most: effects in one hypothesis.
    """

    kits: tuple[Kit, ...]
    shown: tuple[tuple[Form, ...], ...] = ()
    most: int = 5

    def kit(self, hypothesis: Hypothesis) -> Kit:
        """Return what may be put into the structure of a hypothesis."""
        return next(x for x in self.kits if x.structure is hypothesis.structure)


Move = Callable[[Archive, Catalogue, Fitted], Sequence[Scan | Start]]


def add(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """One effect more, any that is not there."""
    del archive
    hypothesis = fitted.hypothesis
    if len(hypothesis.parts) >= catalogue.most:
        return []
    return [Scan(fitted, tuple(x for x in catalogue.kit(hypothesis).forms if _is_another(hypothesis, x.effect)))]


def drop(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """One effect less, each in turn; freed numbers of the model as given."""
    del archive, catalogue
    return [Start(x) for x in _lacking_one(fitted.hypothesis)]


def swap(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """Another effect in the place of each, of those that were fitted anywhere."""
    hypothesis = fitted.hypothesis
    likely = {y for x in archive.fits for y in x.hypothesis.effects} - set(hypothesis.effects)
    others = tuple(x for x in catalogue.kit(hypothesis).forms if x.effect in likely)
    rests = [archive.fit(x) for x in _lacking_one(hypothesis) if x.own is hypothesis.own]
    return [Scan(x, tuple(y for y in others if _is_another(x.hypothesis, y.effect))) for x in rests if x is not None]


def reform(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """Each effect in its other forms, and in its own form from other values."""
    hypothesis = fitted.hypothesis
    found: list[Scan | Start] = []
    for k, part in enumerate(hypothesis.parts):
        rest = archive.fit(hypothesis.minus(k)) if hypothesis.free_count > len(part.values) else None
        parent = rest or archive.bare(hypothesis.structure)
        if parent is not None:
            found.append(Scan(parent, catalogue.kit(hypothesis).of(part.form.effect)))
    return found


def reform_as_given(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """Each effect anew beside the numbers of the model as given: freed ones may have led it to another valley."""
    hypothesis = fitted.hypothesis
    plain = None if hypothesis.own is None else archive.fit(replace(hypothesis, own=None))
    return [] if plain is None else reform(archive, catalogue, plain)


def simplify(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """Each effect in the plainer form that its own refines, and of a form that is two effects the other one alone."""
    del archive
    found: list[Start] = []
    hypothesis = fitted.hypothesis
    for k, part in enumerate(hypothesis.parts):
        kit, form = catalogue.kit(hypothesis), part.form
        plain = next((x for x in kit.of(form.effect) if x.name == form.refines), None)
        if plain is not None:
            found.append(Start(_placed(hypothesis, k, Part(plain, part.values[: len(plain.free)]))))
        if form.beside and form.beside not in hypothesis.effects:
            alike = (x for x in kit.of(form.beside) if _names(x) == form.curve)
            found += [Start(_placed(hypothesis, k, Part(x, form.curve_alone(part.values)[1]))) for x in alike]
    return found


def other_side(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """Each effect that has its equal on the other side of the plant, there."""
    del archive
    hypothesis, found = fitted.hypothesis, []
    for k, part in enumerate(hypothesis.parts):
        other = EFFECTS[part.form.effect].same_on_other_side
        if not other or other in hypothesis.effects or part.form.shown:
            continue
        forms = [x for x in catalogue.kit(hypothesis).of(other) if len(x.free) == len(part.form.free)]
        found += [Start(_placed(hypothesis, k, Part(x, part.values))) for x in forms[:1]]
    return found


def split(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """Two effects in the place of one that may look like both."""
    del archive
    hypothesis, found = fitted.hypothesis, []
    for k, part in enumerate(hypothesis.parts):
        rest = hypothesis.minus(k)
        for pair in EFFECTS[part.form.effect].splits_into:
            forms = [next(iter(catalogue.kit(hypothesis).of(x)), None) for x in pair]
            if len(rest.parts) + 2 > catalogue.most or set(pair) & {*rest.effects, *names_of(rest.own)}:
                continue
            known = [x for x in forms if x is not None]
            if len(known) == 2:
                found += [Start(_with_two(rest, known, part.values[0], share)) for share in SPLITS]
    return found


def _names(form: Form) -> tuple[str, ...]:
    return tuple(x.name for x in form.free)


def _with_two(rest: Hypothesis, forms: Sequence[Form], scale: float, share: float) -> Hypothesis:
    """Return a hypothesis with two effects: lags share a time, what is a ratio sets out from the model as given."""
    for form, part in zip(forms, (share, 1.0 - share), strict=True):
        first = form.free[0]
        rest = rest.plus(form, (1.0 if first.rings == "ratio" else max(part * scale, 2.0 * first.low),))
    return rest


def free_numbers(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """The model's own linear numbers free beside the effects, from as given and from where they fit best alone."""
    hypothesis = fitted.hypothesis
    own = catalogue.kit(hypothesis).own
    if own is None or hypothesis.own is not None:
        return []
    for free in own.free:
        # beside an effect that is another number of the model's, that number stands
        one = Part(replace(own, free=(free,)), free.starts)
        own = own.holding(free.name, free.starts[0]) if names_of(one) & set(hypothesis.effects) else own
    if not own.free:
        return []
    given = tuple(x.starts[0] for x in own.free)
    alone = archive.fit(Hypothesis(structure=hypothesis.structure).freeing(own, given))
    starts = [given, *([] if alone is None or alone.hypothesis.own is None else [alone.hypothesis.own.values])]
    return [Start(hypothesis.freeing(own, x)) for x in starts]


def hold_numbers(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """Each freed number of the model as given."""
    del archive, catalogue
    hypothesis, own = fitted.hypothesis, fitted.hypothesis.own
    if own is None:
        return []
    found = []
    for k, free in enumerate(own.form.free):
        form = own.form.holding(free.name, free.starts[0])
        rest = own.values[:k] + own.values[k + 1 :]
        found.append(Start(hypothesis.freeing(form, rest) if rest else replace(hypothesis, own=None)))
    return found


def name_numbers(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """Another frequency or damping that is free, as the effect that it is: that may go further than a recalibration."""
    del archive
    hypothesis, own = fitted.hypothesis, fitted.hypothesis.own
    named = () if own is None else changes_as_effects(own, catalogue.kit(hypothesis).forms)
    if own is None or not named or len(hypothesis.parts) + len(named) > catalogue.most:
        return []
    rest = part_without_named(own, {x.form.effect for x in named})
    alone = [replace(hypothesis, parts=(*hypothesis.parts, x), own=None) for x in named]
    return [Start(x) for x in (replace(hypothesis, parts=(*hypothesis.parts, *named), own=rest), *alone)]


def aliases(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """Each resonance, the model's own included, at its aliases: rows on an even grid hardly distinguish them."""
    del catalogue
    problem = archive.problem
    first_Hz = first_mode_Hz(fitted.hypothesis.linear(problem.base))
    if first_Hz is None or not all(are_even(x.time_s) for x in problem.observations):
        return []
    rates_Hz = {1.0 / float(np.median(np.diff(x.time_s))) for x in problem.observations}
    hypothesis, found = fitted.hypothesis, []
    values = hypothesis.values()
    for k, free in enumerate(hypothesis.free):
        if free.rings not in {"Hz", "ratio", "factor"}:
            continue
        unit_Hz = {"Hz": 1.0, "ratio": first_Hz}.get(free.rings) or first_Hz / free.starts[0]
        own_Hz = unit_Hz * values[k]
        others = {y for x in rates_Hz for y in aliases_Hz(own_Hz, x, unit_Hz * free.high)}
        within = sorted((x for x in others if x > unit_Hz * free.low), key=lambda x: abs(x - own_Hz))
        for other_Hz in within[:ALIASES]:
            found.append(Start(hypothesis.with_values((*values[:k], other_Hz / unit_Hz, *values[k + 1 :]))))
    return found


def rings(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """A delay, or the model's own, by whole periods of the first mode shorter or longer."""
    del catalogue
    first_Hz = first_mode_Hz(fitted.hypothesis.model(archive.problem.base))
    if first_Hz is None:
        return []
    hypothesis, found = fitted.hypothesis, []
    values = hypothesis.values()
    for k, free in enumerate(hypothesis.free):
        if free.rings != "delay":
            continue
        for periods in RINGS:
            delay_s = values[k] + periods / first_Hz
            if free.low < delay_s < free.high:
                found.append(Start(hypothesis.with_values((*values[:k], delay_s, *values[k + 1 :]))))
    return found


def aliases_Hz(frequency_Hz: float, rate_Hz: float, highest_Hz: float) -> list[float]:
    """Return the other frequencies that look alike at so many rows a second."""
    lowest = frequency_Hz % rate_Hz
    turns = range(math.ceil(highest_Hz / rate_Hz) + 1)
    found = (sign * lowest + turn * rate_Hz for turn in turns for sign in (1.0, -1.0))
    return sorted(x for x in found if 0.0 < x <= highest_Hz and not math.isclose(x, frequency_Hz))


def restructure(archive: Archive, catalogue: Catalogue, fitted: Fitted) -> Sequence[Scan | Start]:
    """The same effects in the other linear structures, as far as these can have them."""
    del archive
    hypothesis, found = fitted.hypothesis, []
    for kit in catalogue.kits:
        named = {x.name: x for x in kit.forms}
        if kit.structure is hypothesis.structure or not all(x.form.name in named for x in hypothesis.parts):
            continue
        parts = tuple(Part(named[x.form.name], x.values) for x in hypothesis.parts)
        found.append(Start(Hypothesis(parts, None, kit.structure)))
    return found


def _is_another(hypothesis: Hypothesis, effect: str) -> bool:
    """Return whether an effect is another one than all that a hypothesis has.

    Beside a number of the model that is free, an effect that is a change of it is the same; beside a curve of the
    reading, another one is the same curve.
    """
    if effect in {*hypothesis.effects, *names_of(hypothesis.own)}:
        return False
    return not (EFFECTS[effect].curve_of_reading and any(EFFECTS[x].curve_of_reading for x in hypothesis.effects))


def _lacking_one(hypothesis: Hypothesis) -> list[Hypothesis]:
    """Return the hypothesis without each effect that no witness shows, in turn, and without own numbers."""
    shorter = [hypothesis.minus(k) for k, x in enumerate(hypothesis.parts) if not x.form.shown]
    return shorter if hypothesis.own is None else [*shorter, replace(hypothesis, own=None)]


def _placed(hypothesis: Hypothesis, index: int, part: Part) -> Hypothesis:
    """Return the hypothesis with another part in the place of one."""
    return replace(hypothesis, parts=(*hypothesis.parts[:index], part, *hypothesis.parts[index + 1 :]))


GROW: tuple[Move, ...] = (add,)
BESIDE: tuple[Move, ...] = (free_numbers,)
ADJUST: tuple[Move, ...] = (aliases, rings, reform, other_side, split, name_numbers)
POLISH: tuple[Move, ...] = (restructure, swap, simplify, reform_as_given, hold_numbers, aliases, rings)
AGAINST: tuple[Move, ...] = (drop, swap, other_side)
