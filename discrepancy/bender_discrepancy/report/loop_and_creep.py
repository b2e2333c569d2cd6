"""Effects of many numbers in the few figures that people compare: a loop's width and remanence, creep per decade."""

import math
from typing import Any

import numpy as np

from bender_discrepancy.report.loop_figures import FreeStretch, Loop, loop_of
from bender_effects.catalogue import EFFECTS
from bender_plant.model import Model
from bender_report.number import Number
from bender_report.wording import fields, figure, percent, quantity, with_interval

# weights of plays lean on each other: from this many numbers on, none of them means anything by itself
MANY = 6


def hysteresis_sentence(
    effect_id: str, form: str | None, numbers: tuple[Number, ...], volts: tuple[float, float], model: Model
) -> str:
    """Return a hysteresis in figures of its loop; empty for another effect, or where its numbers say it as well.

    They do where they are few, the records determine each of them, and the loop has no free stretch.

    Args:
        effect_id: of the effect.
        form: of its block.
        numbers: of its block.
        volts: lowest and highest of the records.
        model: the corrected one, whose other blocks the loop passes.
    """
    loop = _loop(effect_id, form, numbers, volts, model)
    if loop is None or (len(numbers) < MANY and loop.free is None and not any(x.is_open for x in numbers)):
        return ""
    told = (
        f"loop width {quantity(loop.width_um, 'um')} between {figure(volts[0])} and {quantity(volts[1], 'V')}, "
        f"remanence {quantity(loop.remanence_um, 'um')} at {quantity(0.0, 'V')} after {quantity(volts[1], 'V')}"
    )
    return told if loop.free is None else f"{told}; {_free_stretch(loop.free)}"


def _loop(
    effect_id: str, form: str | None, numbers: tuple[Number, ...], volts: tuple[float, float], model: Model
) -> Loop | None:
    """Return the loop of a hysteresis in a model between two voltages; None for another effect."""
    if EFFECTS[effect_id].told_as != "loop":
        return None
    known = EFFECTS[effect_id].block.parameters.__dataclass_fields__
    values: dict[str, Any] = {
        name: tuple(x.value for x in found) if "[" in found[0].name else found[0].value
        for name, found in fields(numbers).items()
        if name in known
    }
    return loop_of(model.with_block(effect_id, **values | ({"form": form} if form else {})), *volts)


def figures_of(
    effect_id: str, form: str | None, numbers: tuple[Number, ...], volts: tuple[float, float], model: Model
) -> list[dict[str, Any]]:
    """Return a hysteresis as its loop, creep as its totals per decade, for programs; nothing for another effect.

    Each figure has a `name`, a `value` and its `unit`, and the range `between` which it is read, `between_unit`.
    Arguments are those of `hysteresis_sentence`.
    """
    loop = _loop(effect_id, form, numbers, volts, model)
    if loop is not None:
        found = [("loop_width", loop.width_um, "um"), ("remanence", loop.remanence_um, "um")]
        if loop.free is not None:
            found += [("follows_for", loop.free.after_V, "V"), ("stands_still_for", loop.free.length_V, "V")]
        return [_figure(name, value, unit, volts, "V") for name, value, unit in found]
    pair = _creep(effect_id, numbers)
    if pair is None:
        return []
    gains, taus_s = ([x.value for x in y] for y in pair)
    decades = creep_per_decade(gains, taus_s)
    ends_s = (decades[0][0], decades[-1][1])
    return [
        *(_figure("creep_of_decade", total, "1", (low, high), "s") for low, high, total in decades),
        _figure("creep_in_all", sum(gains), "1", ends_s, "s"),
    ]


def _figure(name: str, value: float, unit: str, between: tuple[float, float], between_unit: str) -> dict[str, Any]:
    return {"name": name, "value": value, "unit": unit, "between": list(between), "between_unit": between_unit}


def _free_stretch(free: FreeStretch) -> str:
    return (
        f"after each reversal the reading follows for {quantity(free.after_V, 'V')}, then stands still for "
        f"{quantity(free.length_V, 'V')} (a free stretch, as clearance makes it) and follows again"
    )


def creep_per_decade(gains: list[float], time_constants_s: list[float]) -> list[tuple[float, float, float]]:
    """Return the sum of the gains in each decade of the time constants that has one: its ends in s, and the sum."""
    found: dict[int, float] = {}
    for gain, tau_s in zip(gains, time_constants_s, strict=True):
        decade = math.floor(math.log10(tau_s) + 1e-9)
        found[decade] = found.get(decade, 0.0) + gain
    return [(10.0**k, 10.0 ** (k + 1), found[k]) for k in sorted(found)]


def creep_table(effect_id: str, numbers: tuple[Number, ...]) -> dict[str, list[tuple[str, str]]] | None:
    """Return creep's relaxations, and their totals per decade and in all; None for another effect."""
    pair = _creep(effect_id, numbers)
    if pair is None:
        return None
    gains, taus = pair
    values, times_s = [x.value for x in gains], [x.value for x in taus]
    order = np.argsort(times_s)
    totals = [
        (f"{figure(low)} to {quantity(high, 's')}", percent(total))
        for low, high, total in creep_per_decade(values, times_s)
    ]
    return {
        "rows": [(with_interval(taus[k]), with_interval(gains[k])) for k in order],
        "totals": [*totals, ("in all", percent(sum(values)))],
    }


def creep_sentence(effect_id: str, numbers: tuple[Number, ...]) -> str:
    """Return creep of many relaxations as its totals per decade; empty for another effect, or one of few numbers."""
    table = creep_table(effect_id, numbers)
    if table is None or len(numbers) < MANY:
        return ""
    *decades, (_, whole) = table["totals"]
    return f"{whole} of the response in all; time constants of " + ", ".join(f"{x}: {y}" for x, y in decades)


def _creep(effect_id: str, numbers: tuple[Number, ...]) -> tuple[list[Number], list[Number]] | None:
    found = fields(numbers)
    gains, taus = found.get("gains", []), found.get("time_constants_s", [])
    return (gains, taus) if EFFECTS[effect_id].told_as == "relaxations" and gains and len(gains) == len(taus) else None
