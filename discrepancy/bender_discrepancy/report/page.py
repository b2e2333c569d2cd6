"""The report: one page that needs nothing beside it, light and dark, on a desk, on a phone and on paper."""

import math
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from bender_discrepancy.conclusion.findings import Findings, ReportedEffect, worst_record
from bender_discrepancy.conclusion.measurement.corrected_model import Gap
from bender_discrepancy.conclusion.measurement.gap import Measured
from bender_discrepancy.conclusion.notes import FIRST_LINE, beginning
from bender_discrepancy.conclusion.sentences import (
    gap_sentence,
    heading_of,
    number_title,
    range_sentence,
    range_words,
    share_words,
    title_of,
)
from bender_discrepancy.conclusion.shares import EQUATION, OWN_NUMBERS
from bender_discrepancy.report import lead_section, overlay_pictures
from bender_discrepancy.report.chart_process import ChartProcess, charts_of
from bender_discrepancy.report.effect_pictures import component_charts
from bender_discrepancy.report.effect_sections import effect_sections, how_sure
from bender_discrepancy.report.pictured_record import PicturedRecord, pictured_record
from bender_discrepancy.report.visible_section import never_visible, visible_rows
from bender_effects.catalogue import EFFECTS
from bender_inference.equation.lead import Lead
from bender_inference.fitting.criterion import very_strong
from bender_inference.structures import AUTO
from bender_plant.model import Model
from bender_report.page import render_template
from bender_report.wording import (
    HALF_WIDTH,
    IN_WORDS,
    figure,
    input_word,
    is_other_rig,
    listed,
    percent,
    quantity,
    uncertain,
    with_units_kept,
)

CHIPS = {
    "named": "named",
    "no_gap": "no gap",
    "recalibrated": "recalibrated",
    "likely": "likely",
    "ambiguous": "ambiguous",
    "unexplained": "unexplained",
}
# a bar longer than this many times the next is torn, so that the rest can be seen
TORN = 4.0
FROM_RECORDS = "A first model from records"
"""So the description of a model begins that was made of them."""
OWN_SURROUNDINGS = ", under each record with its own surroundings"
# a half that holds less than this of the energy tells nothing
TELLING = 0.6
_HOLDS = {"hold": "held", "linear": "straight from row to row", "smooth": "band-limited between the rows"}
_PACKAGES = ("piezo-bender", "numpy", "scipy", "numba", "fmpy")


def report_page(
    findings: Findings,
    measured: Measured,
    result: dict[str, Any],
    lead: Lead | None = None,
    chart_process: ChartProcess | None = None,
) -> str:
    """Return the report as HTML.

    Args:
        findings: what is told.
        measured: the gap, and the readings that the pictures show.
        result: the content of `diagnosis.json`, see `outcome`.
        lead: that of an unexplained diagnosis, see `lead_of`.
        chart_process: draws some of the charts.
    """
    folder = Path(__file__).parent
    worst = worst_record(findings.search)
    shown = pictured_record(findings, measured, worst, result["records"][worst]["name"])
    return render_template(
        "page.html.j2",
        folder,
        (folder / "page.css").read_text(encoding="utf-8"),
        title=result["sentence"],
        charts=charts_of(shown, chart_process),
        components=component_charts(findings, shown, worst),
        component_record=shown.name,
        input_word=input_word(),
        foreign_names=is_other_rig(),
        equation=lead_section.section(
            lead, shown, worst, in_model=findings.search.best.hypothesis.equation is not None
        ),
        **_head(findings, measured, result, shown),
        **_body(findings, measured, result, shown),
    )


def _head(findings: Findings, measured: Measured, result: dict[str, Any], shown: PicturedRecord) -> dict[str, Any]:
    simulated = [title_of(x.id) for x in findings.simulated]
    simulated += ["the equation below"] if findings.search.best.hypothesis.equation is not None else []
    simulated += ["the model's own numbers fitted"] if findings.search.best.hypothesis.own is not None else []
    corrected_label = f"with {listed(simulated)}"
    bars = gap_bars(measured, corrected_label)
    return {
        "verdict": findings.verdict,
        "chip": CHIPS[findings.verdict],
        "headline": with_units_kept(result["sentence"]),
        "gap_sentence": with_units_kept(gap_sentence(findings, measured)),
        "missing": missing_rows(findings, measured, result),
        "several": len(findings.shares) > 1,
        "is_open": any(not x["certain"] for x in result["effects"]),
        "reason": _sentence(result["reason"]) if findings.verdict in ("likely", "ambiguous", "unexplained") else "",
        "base_model": _model_words(findings.search.base),
        "gap_bars": [x for x in bars if simulated or x["kind"] != "with"],
        "corrected_label": corrected_label,
        "held_out": measured.judged,
        "of_records": OWN_SURROUNDINGS if any(x.by_record for x in findings.added) else "",
        "stands_in": "foreign_model" in result,
        "caveats": [_sentence(x) for x in result["warnings"]],
        "next_experiment": result["next_experiment"],
        "would_tell": [_sentence(x["why"]) for x in result["columns_that_would_tell"]],
        "added_text": listed(simulated),
        "corrected": shown.corrected,
        "shows_given": overlay_pictures.is_near(shown),
        "stretch_title": _stretch_title(shown),
    }


def _body(findings: Findings, measured: Measured, result: dict[str, Any], shown: PicturedRecord) -> dict[str, Any]:
    strips, places = _where(result["where"], shown)
    return {
        "strips": strips,
        "places": places,
        "effects": effect_sections(findings, result),
        "interval_words": IN_WORDS,
        "very_strong": figure(very_strong(findings.search.settings.confidence), 2),
        "recalibrated": [
            {
                "name": number_title(x.name),
                "before": quantity(x.before, x.unit),
                "after": ", ".join(uncertain(value, HALF_WIDTH * x.std, x.unit) for value in x.afters or (x.after,))
                + (", the end of its range" if x.at_end else ""),
            }
            for x in findings.recalibrated
        ],
        "visible": visible_rows(result.get("smallest_visible") or {}),
        "never_visible": listed(never_visible(result.get("smallest_visible") or {})),
        "records": _records(findings, measured, result),
        "input_hold": _HOLDS[result["settings"]["input_hold"]],
        "untimed": result["settings"]["untimed"],
        "floor": quantity(measured.floor_um, "um"),
        "model": result["model"],
        "fmu": result["fmu"],
        "versions": " · ".join(f"{name} {found}" for name in _PACKAGES if (found := _version(name))),
    }


def _model_words(base: Model) -> str:
    """Return the name of the model as given, with its structure where that was found in the records."""
    structure = base.description.partition(f"{FROM_RECORDS}: ")[2].partition(";")[0]
    if structure and base.name.startswith(f"{AUTO} "):
        return f"{structure}, from these records"
    return f"{base.name} ({structure})" if structure else base.name


def missing_rows(findings: Findings, measured: Measured, result: dict[str, Any]) -> list[dict[str, str]]:
    """Return what is missing, how sure that is and what it closes: parts of the gap, with the rest, make 100 %."""
    # behind the effects an equation without a name may stand
    pairs = [*zip(findings.effects, result["effects"], strict=False)]
    if not pairs:
        return []
    further = [(OWN_NUMBERS, "The model's own numbers, fitted again"), (EQUATION, "An equation without a name")]
    rest = [(title, percent(findings.shares[x])) for x, title in further if findings.shares.get(x)]
    if measured.closes is not None:
        rest.append(("Not explained", percent(1.0 - measured.closes)))
    return [
        *(_missing_row(findings, x, entry) for x, entry in pairs if "rival_of" not in entry),
        *({"title": x, "sure": "", "closes": y, "beside": ""} for x, y in rest),
        *(_rival_row(x, entry) for x, entry in pairs if "rival_of" in entry),
    ]


def _missing_row(findings: Findings, effect: ReportedEffect, entry: dict[str, Any]) -> dict[str, str]:
    row = {"title": heading_of(effect.id), "sure": how_sure(entry), "beside": ""}
    if effect.contender is None:
        return row | {"closes": with_units_kept(share_words(findings, effect).removeprefix("; "))}
    if EFFECTS[effect.id].of_the_record and effect not in findings.simulated:
        row |= {"beside": "of this record, not in the corrected model"}
    return row | {"closes": percent(effect.share_of_gap)}


def _rival_row(effect: ReportedEffect, entry: dict[str, Any]) -> dict[str, str]:
    title = f"or {title_of(effect.id)} instead of {title_of(entry['rival_of'])}"
    closes = f"{percent(effect.share_of_gap)} in its place"
    return {"title": title, "sure": how_sure(entry), "closes": closes, "beside": ""}


def gap_bars(measured: Measured, after: str) -> list[dict[str, Any]]:
    """Return the gap at its stages as bars; one that would flatten the others is torn."""
    stages: list[tuple[str, str, Gap | None]] = [
        ("as given", "given", measured.before),
        ("recalibrated", "without", measured.recalibrated),
        (after, "with", measured.after),
        ("noise floor", "noise", None),
    ]
    sizes = [measured.floor_um if gap is None else gap.rms_um for _, _, gap in stages]
    longest = max(sizes)
    rest = sorted(sizes)[-2]
    torn = longest > TORN * rest > 0.0
    full = 1.25 * rest if torn else longest
    return [
        {
            "label": label,
            "kind": kind,
            "torn": torn and size == longest,
            "width": _part(size, full),
            "value": quantity(size, "um"),
            "beside": _beside(gap, measured.floor_um),
        }
        for (label, kind, gap), size in zip(stages, sizes, strict=True)
    ]


def _beside(gap: Gap | None, floor_um: float) -> str:
    if gap is None:
        return ""
    ratio = gap.rms_um / floor_um if floor_um else math.inf
    times = f"{figure(ratio, 2)} × noise floor" if floor_um else ""
    span = f"{figure(gap.nrmse_percent, 2)}\u00a0% of span"
    return f"{times}, {span}" if math.isfinite(gap.nrmse_percent) and times else times


def _part(value: float, full: float) -> float:
    return round(100.0 * min(value / full, 1.0), 2) if full > 0.0 else 0.0


def _stretch_title(shown: PicturedRecord) -> str:
    if shown.is_short:
        return "The whole record"
    rows = shown.stretch
    begin, end = shown.axis[rows][[0, -1]]
    ends = f"{figure(begin)} to {figure(end)}" + ("" if shown.axis_label == "row" else " s")
    what = "rows " if shown.axis_label == "row" else ""
    return f"Where the residual was largest among the held-out readings: {what}{ends}"


def _where(found: Sequence[dict[str, Any]], shown: PicturedRecord) -> tuple[list[dict[str, Any]], list[str]]:
    """Return what can be drawn as part of an axis, and the rest in words."""
    steps = np.diff(shown.axis)
    ends = {
        "time": (float(shown.axis[0]), float(shown.axis[-1])),
        "voltage": (float(shown.acting_V.min()), float(shown.acting_V.max())),
        "rate": (0.0, float(np.max(np.abs(np.diff(shown.acting_V)) / steps))),
        "frequency": (0.0, float(0.5 / np.median(steps))),
    }
    strips, words = [], []
    for place in found:
        low, high = ends.get(place["axis"], (0.0, 0.0))
        if high <= low:
            if place["share"] >= TELLING:
                words.append(range_sentence(place))
            continue
        begin, end = (min(max((x - low) / (high - low), 0.0), 1.0) for x in place["range"])
        strips.append(
            {
                "axis": place["axis"].replace("voltage", input_word()),
                "left": round(100.0 * begin, 2),
                "width": round(100.0 * max(end - begin, 0.0), 2),
                "share": percent(place["share"]),
                "range": range_words(place),
            }
        )
    return strips, words


def _records(findings: Findings, measured: Measured, result: dict[str, Any]) -> list[dict[str, Any]]:
    found = []
    for k, (x, row) in enumerate(zip(findings.search.problem.observations, result["records"], strict=True)):
        left = [(x.measured_um - y[k])[x.reporting] for y in (measured.recalibrated_um, measured.after_um)]
        rms = [quantity(math.sqrt(float(np.mean(e**2))), "um") if e.size else "–" for e in left]
        rows = [x + FIRST_LINE for x in row["outlying_rows"]]
        listed_rows = ", ".join(map(str, rows)) + (", …" if row["outlying"] > len(rows) else "")
        begun = beginning(result["start"][k], result["start_input"][k])
        found.append(row | {"listed": listed_rows, "recalibrated": rms[0], "now": rms[1], "begun": begun})
    return found


def _sentence(text: str) -> str:
    first = text.split(" ", 1)[0].rstrip(":")
    start = text[:1].upper() if first.isalpha() and first not in EFFECTS else text[:1]
    return with_units_kept(start + text[1:] + ("" if text.endswith((".", "…")) else "."))


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
