"""The outcome as plain data for a JSON file, and as the lines that a table shows."""

import math
from dataclasses import asdict
from typing import Any

from bender_identify.fitting.resimulation import Score
from bender_identify.identification_result import Identification, Row
from bender_loop.shell.files import finite

COLUMNS = ("model", "parameters", "held-out error %", "rms_um", "fitted error %", "remanence")


def table(outcome: Identification) -> list[list[str | int | float | None]]:
    """Return one line for each model, in the order of `COLUMNS`; the written one is marked."""
    return [
        [
            f"{row.candidate.title}{' *' if row is outcome.written else ''}",
            row.candidate.parameters,
            row.held_out.error_percent,
            row.held_out.rms_um,
            row.fitted.error_percent,
            remanence(row),
        ]
        for row in outcome.rows
    ]


def remanence(row: Row) -> str:
    """Return yes or no with the displacement that stays."""
    if not math.isfinite(row.remanence_um):
        return "runs away at rest"
    return f"yes ({row.remanence_um:.2g} µm)" if row.remanent else "no"


def figures(outcome: Identification) -> dict[str, Any]:
    """Return the outcome as data that JSON can hold; a number that does not exist is None."""
    learned, about = outcome.learned, outcome.identifiability
    found = {
        "written": outcome.written.candidate.id,
        "held_out_by": outcome.held_out_by,
        "floor_percent": outcome.floor_percent,
        "delay_s": outcome.delay_s,
        "records": [
            {
                "name": x.name,
                "rows": len(x.time_s),
                "fitted": int(x.fitted.sum()),
                "held_out": int(x.held_out.sum()),
                "starts_in_motion": x.in_motion,
                "excitation": asdict(x.excitation) | {"single": x.excitation.single},
            }
            for x in outcome.experiments
        ],
        "models": [_model(row) for row in outcome.rows],
        "learned": {
            "terms": list(learned.terms),
            "library": list(learned.library),
            "form": learned.regression.form,
            "inclusion": None
            if learned.ensemble is None
            else dict(zip(learned.regression.terms, learned.ensemble.inclusion.tolist(), strict=True)),
            "simulated_supports": [
                {"terms": list(trial.terms), "rms_um": float(trial.fit.residual_um.std())} for trial in learned.trials
            ],
        },
        "identifiability": asdict(about),
        "unseen_percent": asdict(outcome.unseen),
        "findings": list(outcome.findings),
    }
    return finite(found)


def _model(row: Row) -> dict[str, Any]:
    candidate = row.candidate
    return {
        "id": candidate.id,
        "title": candidate.title,
        "equation": candidate.equation,
        "parameters": candidate.parameters,
        "offset_um": candidate.fit.offset_um,
        "coefficients": [asdict(c) for c in candidate.coefficients],
        "fitted": _score(row.fitted),
        "held_out": _score(row.held_out),
        "remanence_um": row.remanence_um,
        "remanent": row.remanent,
    }


def _score(score: Score) -> dict[str, float]:
    return asdict(score)
