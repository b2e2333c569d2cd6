"""The example of a fleet diagnosed as anybody would, and held to its truth."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bender_fleet.page.page import PAGE
from bender_fleet.population.features import read_population
from bender_fleet.population.trends import bad_batches, drifts
from bender_loop.errors import InputError

HIDDEN_EFFECT = "saturation"
"""Of the bad batch."""


@dataclass(frozen=True, slots=True)
class TruthComparison:
    """A fleet held to its truth.

    Attributes:
        readable: units whose record is whole.
        right: of these, the verdict is `named` and the effects are those that are hidden.
        wrong: the others: unit, what is hidden, what was said.
        broken: units with a broken file.
        told_broken: of these, a row with a reason.
        batch: whether the bad batch is found by its effect.
        drift: whether the drift of the gain is found.
        on_page: whether the page shows batch, drift and broken files.
    """

    readable: int
    right: int
    wrong: tuple[tuple[str, str, str], ...]
    broken: int
    told_broken: int
    batch: bool
    drift: bool
    on_page: bool


def compare_with_truth(out: Path, truth: Path) -> TruthComparison:
    """Return how the results of a fleet compare with what was hidden; units that were not reached are left out."""
    known: dict[str, Any] = json.loads(truth.read_text(encoding="utf-8"))
    population = read_population(out)
    if not set(population.place) <= set(known["units"]):
        raise InputError(f"{truth}: found other units than in {out}, expected the truth of this fleet")
    wrong: list[tuple[str, str, str]] = []
    readable = broken = told = 0
    for row in population.units:
        hidden = known["units"][row["unit"]]
        if hidden["broken"]:
            broken += 1
            told += row["status"] == "broken" and bool(row["reason"])
            continue
        readable += 1
        names = {x["id"] for x in hidden["effects"]}
        if row["verdict"] != "named" or set(row["effects"]) != names:
            said = f"{row['verdict'] or row['status']}: {', '.join(row['effects'] or ()) or row['reason'] or 'nothing'}"
            wrong.append((row["unit"], ", ".join(sorted(names)), said))
    batch = any(x.batch == known["bad_batch"] and x.label == HIDDEN_EFFECT for x in bad_batches(population))
    drift = any(x.label == "gain" for x in drifts(population))
    page = (out / PAGE).read_text(encoding="utf-8")
    shown = all(
        x in page for x in (f"{known['bad_batch']}: {HIDDEN_EFFECT}", "With the date: gain", "Units without a result")
    )
    return TruthComparison(readable, readable - len(wrong), tuple(wrong), broken, told, batch, drift, shown)
