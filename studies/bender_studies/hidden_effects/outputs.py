"""The tables of the judge, for a terminal and as JSON."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from bender_loop.shell.files import result_text
from bender_studies.hidden_effects.figures import (
    Figure,
    candidates_of,
    confusion,
    false_names,
    figures,
    figures_of_fmu,
    seconds_of,
)
from bender_studies.hidden_effects.judging import Judged

DRAWN = (
    "drawn so that every hidden effect shows: cases are redrawn until it leaves at least 3 times the noise "
    "(5 times outside the catalogue), alone and beside its partner"
)
COLUMNS = ("what is judged", "cases", "found", "95 %", "promised", "kept")


def cells(figure: Figure) -> list[str]:
    """Return one row of the table."""
    sign = "at most" if figure.at_most else "at least"
    between = f"{100 * figure.interval[0]:.0f} … {100 * figure.interval[1]:.0f} %" if figure.interval else "–"
    kept = "yes" if figure.is_kept else "no"
    value, promised = f"{100 * figure.value:.1f} %", f"{sign} {100 * figure.promised:.0f} %"
    return [figure.words, str(figure.count), value, between, promised, kept]


def confusion_cells(cases: Sequence[Judged]) -> list[list[str]]:
    """Return the rows of the confusion matrix that are not on its diagonal, and a count of those that are."""
    return [[truth, said, str(count)] for truth, said, count in confusion(cases) if truth != said]


def sentences(cases: Sequence[Judged]) -> list[str]:
    """Return what a person should read below the tables."""
    wrong = false_names(cases)
    listed = ", ".join(f"{name} {count}" for name, count in wrong.most_common()) or "none"
    middle, longest = seconds_of(cases)
    failed = sum(x.answer.verdict == "error" for x in cases)
    told = [f"false names: {listed}", f"wall time of a diagnosis: median {middle:.1f} s, longest {longest:.1f} s"]
    if (listed_by := candidates_of(cases)) is not None:
        told.append(f"candidates of an ambiguous answer: median {listed_by[0]:g}, most {listed_by[1]}")
    told.append(DRAWN)
    return [*told, f"diagnoses that failed: {failed}"] if failed else told


def clean(cases: Sequence[Judged]) -> list[Judged]:
    """Return the cases whose frames are all there and right."""
    return [x for x in cases if not x.spoiled]


def spoiled(cases: Sequence[Judged]) -> list[Judged]:
    """Return the cases with lost and outlying frames."""
    return [x for x in cases if x.spoiled]


def to_json(settings: dict[str, Any], cases: Sequence[Judged]) -> str:
    """Return everything as JSON."""
    told = figures_of_fmu if settings.get("as_fmu") else figures
    table = {
        "settings": settings,
        "figures": [_figure(x) for x in told(clean(cases))],
        "spoiled": [_figure(x) for x in told(spoiled(cases))],
        "confusion": [{"hidden": t, "said": s, "cases": n} for t, s, n in confusion(cases)],
        "false_names": dict(false_names(cases)),
        "cases": [_case(x) for x in cases],
    }
    return result_text(table, indent=1)


def _figure(x: Figure) -> dict[str, Any]:
    value = x.value if math.isfinite(x.value) else None
    return asdict(x) | {"value": value, "kept": x.is_kept}


def _case(x: Judged) -> dict[str, Any]:
    def number(value: float) -> float | None:
        return round(value, 4) if math.isfinite(value) else None

    return {
        "id": x.answer.id,
        "kind": x.kind,
        "hidden": list(x.truth),
        "sensor": x.sensor,
        "moved": x.moved,
        "lookalike": x.lookalike,
        "spoiled": x.spoiled,
        "verdict": x.answer.verdict,
        "named": list(x.answer.named),
        "rivals": list(x.answer.rivals),
        "right": x.is_right,
        "asked_for": [*(["experiment"] if x.answer.profile else []), *x.answer.columns],
        "after_experiment": list(x.after.named) if x.after else None,
        "right_after": x.is_right_after,
        "over_floor": number(x.over_floor),
        "candidates": list(x.candidates),
        "told": {k: {"probability": x.answer.probabilities[k], "case": list(v)} for k, v in x.answer.cases.items()},
        "of_second_gap": number(x.of_second_gap),
        "seconds": round(x.answer.seconds, 2),
        "error": x.answer.error,
    }
