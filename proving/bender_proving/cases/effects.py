"""The table of everything that can be hidden in a bench."""

from bender_proving.physics import material, sensor, structure, supply, surroundings
from bender_proving.cases import outside
from bender_proving.cases.hidden import Effect, Hidden, Sensor, Stage

INSIDE: dict[str, Effect] = {
    effect.id: effect
    for table in (supply.EFFECTS, material.EFFECTS, structure.EFFECTS, surroundings.EFFECTS, sensor.EFFECTS)
    for effect in table
}
OUTSIDE: dict[str, Effect] = {effect.id: effect for effect in outside.EFFECTS}


def effect(effect_id: str) -> Effect:
    """The entry of that name.

    Raises:
        ValueError: there is none.
    """
    table = INSIDE | OUTSIDE
    if effect_id not in table:
        raise ValueError(f"effect must be one of {', '.join(table)}, found {effect_id!r}")
    return table[effect_id]


def of_stage(hidden: tuple[Hidden, ...], stage: Stage) -> tuple[Hidden, ...]:
    """Those of `hidden` that sit in that stage."""
    return tuple(item for item in hidden if effect(item.id).stage == stage)


def common_sensors(effect_ids: tuple[str, ...]) -> tuple[Sensor, ...]:
    """Sensors on whose records every one of these effects is excited."""
    tables = [effect(name).ranges for name in effect_ids]
    return tuple(sensor for sensor in ("camera", "vibrometer") if all(sensor in table for table in tables))
