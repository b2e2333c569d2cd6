"""The sections of a report that tell of one effect each: evidence, ranking, numbers, what it is."""

import math
from typing import Any

from bender_discrepancy.conclusion.findings import Findings, ReportedEffect
from bender_discrepancy.conclusion.sentences import heading_of, title_of
from bender_discrepancy.report.device_words import for_device
from bender_discrepancy.report.loop_and_creep import creep_table, hysteresis_sentence
from bender_effects.catalogue import EFFECTS
from bender_effects.rigs import is_piezo_bender
from bender_export.build import checkout_folder
from bender_inference.fitting.criterion import very_strong
from bender_report.number import Number
from bender_report.wording import chance, fields, figure, quantity, with_interval, with_units_kept

MOST_RIVALS = 8
MOST_LINES = 6
NOTHING = "nothing in its place"


def effect_sections(findings: Findings, result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what the page says of each effect, in order."""
    volts, decides = driven_V(findings), very_strong(findings.search.settings.confidence)
    return [
        _section(findings, x, entry, volts, decides)
        for x, entry in zip(findings.effects, result["effects"], strict=False)
    ]


def driven_V(findings: Findings) -> tuple[float, float]:
    """Return the lowest and the highest voltage of the records."""
    acting = [x.acting_V for x in findings.search.problem.observations]
    return min(float(x.min()) for x in acting), max(float(x.max()) for x in acting)


def _section(
    findings: Findings, effect: ReportedEffect, entry: dict[str, Any], volts: tuple[float, float], decides: float
) -> dict[str, Any]:
    about, bender = EFFECTS[effect.id], is_piezo_bender(findings.search.base)
    # what so few readings cannot weigh has no bar
    rivals = [(x["id"], x["delta_bic"]) for x in entry["rivals"] if x["delta_bic"] is not None]
    rival_of = entry.get("rival_of")
    without = entry.get("delta_bic_without")
    open_ = frozenset(x.id for x in effect.contender.rivals if x.reach) if effect.contender else frozenset[str]()
    rows = [_row(effect, field, numbers, bender=bender) for field, numbers in fields(effect.numbers).items()]
    ranking, line = ([], 0.0) if rival_of else ranking_bars(heading_of(effect.id), rivals, decides, without, open_)
    return {
        "id": effect.id,
        "title": heading_of(effect.id),
        "rival_of": title_of(rival_of) if rival_of else None,
        "sure": how_sure(entry),
        "summary": for_device(about.summary if bender else about.in_general or about.summary, bender=bender),
        "evidence": with_units_kept(entry["evidence"]),
        "ranking": ranking,
        "line": line,
        "form": (effect.form or "").replace("_", "-"),
        "rows": rows,
        "has_typical": any(x["typical"] != "–" for x in rows),
        "has_deviations": any(x.std > 0.0 for x in effect.numbers),
        "in_figures": hysteresis_sentence(effect.id, effect.form, effect.numbers, volts, findings.model),
        "relaxations": creep_table(effect.id, effect.numbers),
        "signature": for_device(about.signature, bender=bender),
        "separation": for_device(about.separation, bender=bender),
        "excitation": for_device(about.excitation, bender=bender),
        "page": about.page,
        "address": _address(about.page),
    }


def how_sure(entry: dict[str, Any]) -> str:
    """Return how sure an effect is, in words and as a number from 0 to 1."""
    return "certain" if entry["certain"] else f"{entry['grade']}, probability {chance(entry['probability'])}"


def _address(page: str) -> str | None:
    """Return the address of a page of the documentation in the checkout, None in an installed package."""
    folder = checkout_folder()
    return None if folder is None else (folder.parent / page).as_uri()


def ranking_bars(
    title: str,
    rivals: list[tuple[str, float]],
    decides: float,
    without: float | None = None,
    open_: frozenset[str] = frozenset(),
) -> tuple[list[dict[str, Any]], float]:
    """Return the rivals as bars on a logarithmic scale, the effect itself first, and where the evidence decides (%).

    Args:
        title: of the effect.
        rivals: in its place, each with the evidence against it.
        decides: so much evidence.
        without: the evidence against nothing in its place.
        open_: rivals that are not ruled out, though the evidence against them may decide.
    """
    shown = sorted(rivals[:MOST_RIVALS], key=lambda x: x[1])
    if without is not None:
        shown = [*shown, (NOTHING, without)]
    if not shown:
        return [], 0.0
    full = _length(max(max(x for _, x in shown), 3.0 * decides))
    bars = [{"label": title, "kind": "with", "width": 0.0, "value": "best" if shown[0][1] >= 0.0 else "0"}]
    for name, difference in shown:
        width = round(100.0 * _length(difference) / full, 2)
        label = heading_of(name) if name in EFFECTS else name
        kind = "without" if difference < decides or name in open_ else "rival"
        bars.append({"label": label, "kind": kind, "width": width, "value": f"{figure(difference)}"})
    return bars, round(100.0 * _length(decides) / full, 2)


def _length(difference: float) -> float:
    return math.log10(1.0 + max(difference, 0.0))


def _row(effect: ReportedEffect, field: str, numbers: list[Number], *, bender: bool) -> dict[str, Any]:
    about = EFFECTS[effect.id]
    first = numbers[0]
    fixed = all(x.std == 0.0 for x in numbers)
    lines = [with_interval(x) for x in numbers[:MOST_LINES]]
    if len(numbers) > MOST_LINES:
        lines = [f"{len(numbers)} values, {_ends(numbers)}"]
    typical = f"{figure(first.typical[0])} to {quantity(first.typical[1], first.unit)}" if first.typical else "–"
    return {
        "name": field,
        "text": for_device(about.parameters[field].text, bender=bender)
        + (" (fixed by the form)" if fixed and effect.contender else ""),
        "lines": lines,
        "typical": typical,
        "why": first.why,
        "unusual": any(x.unusual for x in numbers),
    }


def _ends(numbers: list[Number]) -> str:
    values = [x.value for x in numbers]
    return f"{figure(min(values))} to {quantity(max(values), numbers[0].unit)}"
