"""The model's own linear numbers, free beside effects: frequency, damping, lags and delay, where the model has them.

Gain and offset are solved for in every evaluation. These are searched with the numbers of the effects, from where the
model has them and from where they fit best without any effect: an effect that shifts a resonance shows only where the
frequency of the model may give way. Another frequency or damping of the first mode has a name in the catalogue.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass

from bender_effects.effect import UNSEEN_OF_A_ROW
from bender_effects.form import Form, Free, Values
from bender_inference.fitting.hypothesis import Part
from bender_inference.records.ringing import first_resonance
from bender_plant.blocks import (
    bending_modes,
    plant_lag,
    sensor_lag,
    source_resistance,
    structural_damping,
    tip_mass,
    transport_delay,
)
from bender_plant.model import Model
from bender_plant.plant import effective_settings

OWN = "own numbers"
DELAY = transport_delay.ID
# a model that is further off is another device
FREQUENCY_WITHIN = 2.0
OTHERS_WITHIN = 10.0
# a lag may be that of another supply: from what no reading shows to what is as slow as the record
TIMES_UP_TO = 100.0
# polymers soften by 0.2 to 0.5 % a kelvin, their resonances fall by half of that: less is no other resonance
A_KELVIN = 0.001


@dataclass(frozen=True, slots=True)
class OwnNumber:
    """One of the model's own linear numbers: the block, its parameter, the value as given, how far it may go."""

    block: str
    parameter: str
    given: float
    within: float

    @property
    def name(self) -> str:
        """How it is called in a report: "bending_modes.damping_ratio"."""
        return f"{self.block}.{self.parameter}"


_WHERE = (
    (bending_modes.ID, "frequency_factor", FREQUENCY_WITHIN),
    (bending_modes.ID, "damping_ratio", OTHERS_WITHIN),
    (source_resistance.ID, "time_constant_s", OTHERS_WITHIN),
    (plant_lag.ID, "time_constant_s", OTHERS_WITHIN),
    (plant_lag.ID, "second_time_constant_s", OTHERS_WITHIN),
    (sensor_lag.ID, "time_constant_s", OTHERS_WITHIN),
    (transport_delay.ID, "delay_s", OTHERS_WITHIN),
)

_RINGS = {f"{bending_modes.ID}.frequency_factor": "factor", f"{transport_delay.ID}.delay_s": "delay"}
_NAMED = {
    f"{bending_modes.ID}.frequency_factor": tip_mass.ID,
    f"{bending_modes.ID}.damping_ratio": structural_damping.ID,
}


def own_numbers(base: Model) -> tuple[OwnNumber, ...]:
    """Return the linear numbers that a model has and that are not nought."""
    blocks = {x.id: x.parameters for x in base.blocks}
    found = [
        OwnNumber(block, name, float(getattr(blocks[block], name)), within)
        for block, name, within in _WHERE
        if block in blocks
    ]
    return tuple(x for x in found if x.given > 0.0)


def own_form(base: Model, longest_s: float = math.inf, row_s: float = 0.0) -> Form | None:
    """Return the form that frees them; None where the model has none but gain and offset.

    Args:
        base: the model.
        longest_s: a lag that becomes slower is an integrator, whose gain no record shows.
        row_s: between two rows; a lag that is far quicker shows in none of them, and takes many sub-steps.
    """
    numbers = own_numbers(base)
    if not numbers:
        return None

    def free_of(x: OwnNumber) -> Free:
        low, high = _lowest(x, row_s), _highest(x, longest_s)
        return Free(x.name, low, high, True, (x.given,), rings=_RINGS.get(x.name, ""))

    def apply(model: Model, values: Values) -> Model:
        changed: dict[str, dict[str, float]] = {}
        for x, value in zip(numbers, values, strict=True):
            changed.setdefault(x.block, {})[x.parameter] = value
        for block, new in changed.items():
            settings = next(x.parameters for x in model.blocks if x.id == block)
            model = model.with_block(block, **(asdict(settings) | new))
        return model

    return Form(OWN, OWN, tuple(free_of(x) for x in numbers), apply)


def form_without_named(own: Form, effects: Collection[str]) -> Form | None:
    """Return the form without the numbers whose change is one of some effects; None where no other is left."""
    for x in own.free:
        if _NAMED.get(x.name) in effects:
            own = own.holding(x.name, x.starts[0])
    return own if own.free else None


def effects_of(own: Form | None) -> frozenset[str]:
    """Return the effects of the catalogue that are changes of numbers that a form frees."""
    return frozenset(_NAMED[x.name] for x in own.free if x.name in _NAMED) if own is not None else frozenset()


def names_of(own: Part | None) -> frozenset[str]:
    """Return the effects of the catalogue that numbers of the model, where they are free, are changes of."""
    return effects_of(None if own is None else own.form)


def part_without_named(own: Part, effects: Collection[str]) -> Part | None:
    """Return freed numbers without those whose change is one of some effects; None where no other is left."""
    form, values = own.form, dict(zip([x.name for x in own.form.free], own.values, strict=True))
    for x in own.form.free:
        if _NAMED.get(x.name) in effects:
            form = form.holding(x.name, x.starts[0])
    return Part(form, tuple(values[x.name] for x in form.free)) if form.free else None


def changes_as_effects(own: Part, forms: Sequence[Form]) -> tuple[Part, ...]:
    """Return changed numbers of a model as the effects that they are, where one of the forms is theirs.

    A resonance that is off by less than a kelvin changes it stays a number of the model.
    """
    found = []
    for free, value in zip(own.form.free, own.values, strict=True):
        form = next((x for x in forms if x.effect == _NAMED.get(free.name)), None)
        given = free.starts[0]
        if form is not None and not (form.effect == tip_mass.ID and abs(value / given - 1.0) < A_KELVIN):
            found.append(Part(form, (value / given if form.effect == tip_mass.ID else value,)))
    return tuple(found)


def first_mode(model: Model) -> dict[str, float]:
    """Return the numbers of a model's first mode that have a name in the catalogue, effects applied, by that name."""
    modes = next((settings for block, settings in effective_settings(model) if block.id == bending_modes.ID), None)
    if modes is None:
        return {}
    numbers = {name.rpartition(".")[2]: effect for name, effect in _NAMED.items()}
    return {effect: float(getattr(modes, name)) for name, effect in numbers.items()}


def first_mode_Hz(model: Model) -> float | None:
    """Return the frequency of a model's first mode, effects applied; None for a model that has no modes."""
    first = first_resonance(model)
    if first is None:
        return None
    own = next(x.parameters for x in model.blocks if x.id == bending_modes.ID)
    return first[0] * first_mode(model)[tip_mass.ID] / own.frequency_factor


def _lowest(x: OwnNumber, row_s: float) -> float:
    unseen = min(x.given, UNSEEN_OF_A_ROW * row_s) if x.parameter.endswith("time_constant_s") else 0.0
    return max(x.given / x.within, unseen)


def _highest(x: OwnNumber, longest_s: float) -> float:
    if x.parameter.endswith("_s"):
        return max(x.given, min(x.given * TIMES_UP_TO, longest_s))
    # an oscillation that is damped more is none
    return min(x.given * x.within, 0.9) if x.parameter == "damping_ratio" else x.given * x.within
