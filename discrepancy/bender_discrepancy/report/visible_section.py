"""The section of a report that says how small an effect the records would have shown."""

from collections.abc import Mapping
from typing import Any

from bender_discrepancy.conclusion.sentences import heading_of, title_of
from bender_effects.catalogue import EFFECTS
from bender_report.wording import figure, quantity

OR_LESS = {"above": "", "below": " or less"}
MORE = " more than the model has"
DIGITS = (2, 3, 4, 5, 6, 7)


def visible_rows(smallest: Mapping[str, Mapping[str, Any]]) -> list[dict[str, str]]:
    """Return a row for every effect that would show.

    Args:
        smallest: `smallest_visible` of `diagnosis.json`.
    """
    return [_row(name, entry) for name, entry in smallest.items() if entry["value"] is not None]


def never_visible(smallest: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the effects that the records would not show at any size that was sought; arguments of `visible_rows`."""
    return [title_of(name) for name, entry in smallest.items() if entry["value"] is None]


def _row(name: str, entry: Mapping[str, Any]) -> dict[str, str]:
    field = entry["parameter"].partition("[")[0]
    neutral = EFFECTS[name].defaults.get(field)
    at = (f"{x} {quantity(y['value'], y['unit'], 2)}" for x, y in entry.get("at", {}).items())
    return {
        "title": heading_of(name),
        "parameter": entry["parameter"],
        "size": _size(entry["value"], entry["unit"], neutral)
        + (MORE if entry.get("further") else OR_LESS[entry["shown"]]),
        "at": ", ".join(at),
    }


def _size(value: float, unit: str, neutral: Any) -> str:
    """Return a size with two digits, or as many as distinguish it from no effect."""
    others = [neutral] if isinstance(neutral, float) else []
    digits = next((n for n in DIGITS if all(figure(value, n) != figure(x, n) for x in others)), DIGITS[-1])
    return quantity(value, unit, digits)
