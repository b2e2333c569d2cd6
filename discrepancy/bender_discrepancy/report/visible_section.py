"""The section of a report that says how small an effect the records would have shown."""

from collections.abc import Mapping
from typing import Any

from bender_discrepancy.conclusion.sentences import heading_of
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_report.wording import figure, quantity

NEVER = "none of the effects that were sought, or a size that is too small to simulate"
UP_TO = {"above": "", "below": "up to "}
DIGITS = (2, 3, 4, 5, 6, 7)


def visible_rows(smallest: Mapping[str, Mapping[str, Any]]) -> list[dict[str, str]]:
    """Return a row for every effect.

    Args:
        smallest: `smallest_visible` of `diagnosis.json`.
    """
    return [_row(name, entry) for name, entry in smallest.items()]


def _row(name: str, entry: Mapping[str, Any]) -> dict[str, str]:
    field = entry["parameter"].partition("[")[0]
    neutral = EFFECTS[name].defaults.get(field)
    at = (f"{x} {quantity(y['value'], y['unit'], 2)}" for x, y in entry.get("at", {}).items())
    return {
        "title": heading_of(name),
        "parameter": entry["parameter"],
        "size": NEVER
        if entry["value"] is None
        else UP_TO[entry["shown"]] + _size(entry["value"], entry["unit"], neutral),
        "at": ", ".join(at),
    }


def _size(value: float, unit: str, neutral: Any) -> str:
    """Return a size with two digits, or as many as distinguish it from no effect."""
    others = [neutral] if isinstance(neutral, float) else []
    digits = next((n for n in DIGITS if all(figure(value, n) != figure(x, n) for x in others)), DIGITS[-1])
    return quantity(value, unit, digits)
