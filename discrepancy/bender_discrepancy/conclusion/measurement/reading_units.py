"""Sizes of effects in the unit of the reading: the gain of a recalibrated model belongs to its transduction.

A fit finds a gain g behind everything, r = g y. Of a piezo bender that is what the camera's ruler was wrong by: y is in
true micrometres. Another device has no ruler: its reading is what there is, and g is a better gain of the device. So it
moves in front of the effects, whose lengths are then those of the reading: K -> g K, and every number with the unit
um^p -> g^p times as much. The readings stay what they were.
"""

import re
from dataclasses import fields, replace
from typing import Any

from bender_effects.rigs import is_piezo_bender
from bender_plant.blocks import BLOCKS, calibration, linear_transduction, residual_equation
from bender_plant.model import BlockSettings, Model, ModelError
from bender_plant.parameter import meanings

_LENGTH = re.compile(r"(?<![a-z])um(\d*)")
_AS_THEY_ARE = (str, bool, int, float, type(None))


def length_power(unit: str) -> int:
    """Return p of a unit that grows with um^p: 1 of `um/s`, -2 of `1/um2`."""
    above, _, below = unit.partition("/")
    return sum(int(x or "1") for x in _LENGTH.findall(above)) - sum(int(x or "1") for x in _LENGTH.findall(below))


def gain_of_the_device(base: Model, gain: float) -> float:
    """Return the factor that belongs to the transduction of a model whose reading was found to have a gain.

    1 for a piezo bender, and for a model whose reading has a gain of its own.
    """
    has_none = base.values().get("calibration.gain", 1.0) == 1.0
    is_told = has_none and not is_piezo_bender(base) and linear_transduction.ID in {x.id for x in base.blocks}
    return abs(gain) if is_told and gain != 0.0 else 1.0


def in_reading_units(model: Model, gain: float) -> Model:
    """Return the same plant with a factor of its calibration in the transduction instead.

    Args:
        model: calibrated, with effects.
        gain: to be moved, see `gain_of_the_device`; 1 changes nothing.

    Raises:
        ModelError: a number has no unit to tell what becomes of it, or would be out of its bounds.
    """
    if gain == 1.0:
        return model
    order = list(BLOCKS)
    return replace(
        model,
        blocks=tuple(_moved(x, gain) if order.index(x.id) <= order.index(calibration.ID) else x for x in model.blocks),
    )


def _moved(block: BlockSettings, gain: float) -> BlockSettings:
    settings: Any = block.parameters
    if block.id == residual_equation.ID:
        raise ModelError(f"{block.id}: found an equation, expected numbers with units to tell how they scale")
    if block.id == calibration.ID:
        return replace(block, parameters=replace(settings, gain=settings.gain / gain))
    if block.id == linear_transduction.ID and settings.sensitivity_um_per_V is not None:
        return replace(block, parameters=replace(settings, sensitivity_um_per_V=gain * settings.sensitivity_um_per_V))
    known = meanings(settings)
    changed: dict[str, Any] = {}
    for field in fields(settings):
        value = getattr(settings, field.name)
        if value == field.default:
            continue
        if field.name not in known:
            if not isinstance(value, _AS_THEY_ARE) or "um" in field.name.split("_"):
                raise ModelError(f"{block.id}.{field.name}: found no unit, expected one to tell how it scales")
            continue
        factor = gain ** length_power(known[field.name].unit)
        changed[field.name] = tuple(factor * x for x in value) if isinstance(value, tuple) else factor * value
    return replace(block, parameters=replace(settings, **changed)) if changed else block
