"""What the page shows, from the tables of a fleet: one HTML file that needs nothing beside it."""

import base64
import hashlib
import json
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bender_fleet.page.charts import scatter, strip
from bender_fleet.population.experiment import undecided
from bender_fleet.population.features import Feature, Population, read_population
from bender_fleet.population.outliers import Outlier, distances, outliers
from bender_fleet.population.trends import BatchFinding, bad_batches, batches, drifts, in_batch
from bender_fleet.results.folder import read_fleet
from bender_fleet.results.parts import UNITS
from bender_fleet.sources.keys import folder_name
from bender_loop.shell.files import write_atomically
from bender_report.page import Card, render_template
from bender_report.wording import percent, quantity

PAGE = "fleet.html"
_FILES = {
    "diagnose": "diagnosis.json",
    "compare": "comparison.json",
    "identify": "model-report.html",
    "watch": "watch.json",
}
MOST_LISTED, MOST_DRIFTS, MOST_BATCHES_SHOWN, MOST_EFFECTS_SHOWN = 25, 4, 40, 10
VERDICTS = ("named", "no_gap", "recalibrated", "likely", "ambiguous", "unexplained", "changed", "steady")
_TITLES = {
    "diagnose": "Diagnosis of a fleet",
    "compare": "A model and a fleet",
    "identify": "Models of a fleet",
    "watch": "Watch over a fleet",
}


def write_page(out: Path, action: str) -> Path:
    """Make the page of a fleet from its tables; return where it is.

    Raises:
        InputError: it cannot be written.
    """
    path = out / PAGE
    write_atomically(path, page_of(read_population(out), action, out))
    return path


def page_of(population: Population, action: str, out: Path) -> str:
    """Return the page as HTML; links go to the files that are in the output directory."""
    folder = Path(__file__).parent
    script = (folder / "table.js").read_text(encoding="utf-8")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    far, bad, unsettled = outliers(population), bad_batches(population), undecided(population)[:MOST_LISTED]
    told = read_fleet(out, missing_ok=True) or {}
    count = len(population.units)
    missing = int(told.get("units", count)) - count
    return render_template(
        "page.html.j2",
        folder,
        (folder / "page.css").read_text(encoding="utf-8"),
        title=f"{_TITLES[action]}: {count} unit{'' if count == 1 else 's'}",
        action=action,
        policy=f"; script-src 'sha256-{digest}'",
        script=script,
        lead=_lead(population, far, missing),
        cards=_cards(population),
        pareto=_pareto(population),
        pareto_of=f"Units {'with a change that looks like it' if action == 'watch' else 'in which it is certain'}",
        numbers=_numbers(population.features),
        standing_out=[_outlier(x) for x in far[:MOST_LISTED]],
        more_outliers=max(0, len(far) - MOST_LISTED),
        batch_findings=[_batch_sentence(x) for x in bad[:MOST_LISTED]],
        batch_table=_batch_table(population, bad),
        drifts=[_drift(x) for x in drifts(population)[:MOST_DRIFTS]],
        undecided=unsettled,
        unexplained=[x["unit"] for x in population.units if x.get("verdict") == "unexplained"],
        folders={x: folder_name(x) for u in unsettled for x in u.units[:1]},
        failures=_failures(population),
        table=_table(population, action, out),
    )


def _lead(population: Population, far: Sequence[Outlier], missing: int) -> str:
    done = population.statuses["done"]
    words = [f"{done} of {len(population.units)} units gave a result"]
    bad = population.statuses["broken"] + population.statuses["failed"]
    if bad:
        words.append(f"{bad} could not be used, each with its reason below")
    if missing > 0:
        words.append(f"{missing} were not reached: the run was interrupted")
    if population.has_alarm.any():
        words.append(f"{int(population.has_alarm.sum())} have changed")
    if far:
        words.append(f"{len(far)} stand out from the others")
    return ", ".join(words) + "."


def _cards(population: Population) -> list[Card]:
    verdicts, total = population.verdicts, len(population.units)
    cards = [Card(str(verdicts[x]), x.replace("_", " "), percent(verdicts[x] / total)) for x in VERDICTS if verdicts[x]]
    for status in ("broken", "failed"):
        number = population.statuses[status]
        if number:
            cards.append(Card(str(number), status, percent(number / total)))
    if not verdicts and population.of_units:
        x = population.of_units[-1]
        cards.insert(0, Card(quantity(float(np.median(x.seen)), x.unit), f"median {x.label}"))
    return cards


def _pareto(population: Population) -> list[dict[str, Any]]:
    """Return how often each effect was found, the commonest first, with the share of all findings up to there."""
    found = population.has_effect
    total = max(sum(int(x.sum()) for x in found.values()), 1)
    most = max((int(x.sum()) for x in found.values()), default=1)
    rows, so_far = [], 0
    for name, has in found.items():
        count = int(has.sum())
        so_far += count
        own = [x["share_of_gap"] for x in population.effects if x["effect"] == name and x["certain"]]
        shares = [x for x in own if x is not None]
        rows.append(
            {
                "name": name,
                "count": count,
                "width": round(100.0 * count / most, 2),
                "share": percent(count / len(population.units)),
                "so_far": percent(so_far / total),
                "gap": percent(float(np.median(shares))) if any(shares) else "",
            }
        )
    return rows


def _numbers(features: Sequence[Feature]) -> list[dict[str, Any]]:
    rows = []
    for x in features:
        seen, stds = x.seen, x.stds[np.isfinite(x.values)]
        known = stds[np.isfinite(stds)]
        q = [float(v) for v in np.quantile(seen, [0.05, 0.5, 0.95])]
        rows.append(
            {
                "label": x.label,
                "count": seen.size,
                "median": quantity(q[1], x.unit),
                "range": f"{quantity(q[0])} … {quantity(q[2], x.unit)}",
                "std": quantity(float(np.median(known)), x.unit) if known.size else "–",
                "strip": strip(x),
            }
        )
    return rows


def _outlier(x: Outlier) -> dict[str, Any]:
    return {"unit": x.unit, "distance": f"{x.distance:.1f}", "reasons": "; ".join(x.reasons) or "many small deviations"}


def _batch_sentence(x: BatchFinding) -> str:
    if x.is_share:
        return f"{x.batch}: {x.label} in {percent(x.inside)} of {x.count} units, in {percent(x.outside)} of the others"
    inside, outside = quantity(x.inside, x.unit), quantity(x.outside, x.unit)
    return f"{x.batch}: {x.label} {inside}, of the others {outside} (medians)"


def _batch_table(population: Population, bad: Sequence[BatchFinding]) -> dict[str, Any] | None:
    names = batches(population)
    if not 2 <= len(names) <= MOST_BATCHES_SHOWN or not population.has_effect:
        return None
    effects = list(population.has_effect)[:MOST_EFFECTS_SHOWN]
    marked = {(x.batch, x.label) for x in bad if x.is_share}
    rows = []
    for name in names:
        own = in_batch(population, name)
        count = int(own.sum())
        cells = [
            {"text": percent(population.has_effect[e][own].mean()) if count else "–", "marked": (name, e) in marked}
            for e in effects
        ]
        rows.append({"name": name, "count": count, "cells": cells})
    return {"effects": effects, "rows": rows}


def _drift(x: Any) -> dict[str, Any]:
    share = set(np.unique(x.values)) <= {0.0, 1.0}
    early, late = (percent(v) if share else quantity(v, x.unit) for v in (x.early, x.late))
    return {
        "label": x.label,
        "sentence": f"from {early} in the first quarter of the days to {late} in the last one "
        f"(rank correlation {x.rank_correlation:+.2f}, {x.days.size} units)".replace("-", "−"),
        "svg": scatter(x),
    }


def _failures(population: Population) -> list[dict[str, Any]]:
    """Return the reasons of units without a result, alike ones together."""
    kinds: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for x in population.units:
        if x["status"] != "done":
            kinds.setdefault((x["status"], _kind(x["reason"] or "")), []).append((x["unit"], x["reason"] or ""))
    order = sorted(kinds.items(), key=lambda pair: -len(pair[1]))
    return [
        {"status": status, "count": len(own), "reason": own[0][1], "units": [unit for unit, _ in own[:MOST_LISTED]]}
        for (status, _), own in order[:MOST_LISTED]
    ]


def _kind(reason: str) -> str:
    """Return a reason without what differs from file to file."""
    return re.sub(r"\d+(\.\d+)?", "#", re.sub(r"^\S+?[:,] ", "", reason))


def _table(population: Population, action: str, out: Path) -> str:
    """Return the data of the table as JSON that may stand in a page, column by column."""
    far, _, _ = distances(population)
    units = population.units
    numbers = ["before_um", "recalibrated_um", "after_um", "gain"]
    if action == "compare":
        numbers = ["before_um", "recalibrated_um", "gain", "offset_um"]
    elif action == "identify":
        numbers = ["held_out_percent", "floor_percent"]
    elif action == "watch":
        numbers = ["alarms", "since_s", "change_um", "noise_um", "gain_change", "offset_change_um"]
    data: dict[str, Any] = {
        "unit": [x["unit"] for x in units],
        "batch": _coded(x["batch"] or "" for x in units),
        "date": [x["date"].isoformat() if x["date"] else "" for x in units],
        "verdict": _coded(x.get("verdict") or x.get("learned") or x["status"] for x in units),
        "effects": _coded(", ".join(x.get("effects") or ()) for x in units),
        "numbers": {name: [_rounded(x.get(name)) for x in units] for name in numbers},
        "far": [_rounded(v) for v in far.tolist()],
        "told": [x["reason"] or x.get("sentence") or x.get("equation") or "" for x in units],
        "folder": [folder_name(x["unit"]) for x in units],
        "pages": _linked(out),
        "file": _FILES[action],
        "out": str(out),
        "action": action,
    }
    return json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _linked(out: Path) -> list[str]:
    """Return the folders of units whose report page is drawn."""
    return sorted(x.parent.name for x in (out / UNITS).glob("*/report.html"))


def _coded(values: Any) -> dict[str, Any]:
    """Return texts as a list of different ones, the commonest first, and the place of each in it."""
    texts = list(values)
    order = [x for x, _ in Counter(texts).most_common()]
    place = {x: k for k, x in enumerate(order)}
    return {"of": order, "at": [place[x] for x in texts]}


def _rounded(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(f"{value:.4g}")
