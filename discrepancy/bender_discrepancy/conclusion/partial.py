"""What is kept of a diagnosis that was interrupted: the verdict and the ranking so far, marked partial."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bender_compiled.simulation import Simulator
from bender_discrepancy.conclusion.diagnosis_json import outcome
from bender_discrepancy.conclusion.findings import Findings, find
from bender_discrepancy.conclusion.measurement.corrected_model import corrected, gap
from bender_discrepancy.conclusion.measurement.gap import Measured, after_calibration, chance_um2, closed_part
from bender_discrepancy.conclusion.sentences import title_of
from bender_inference.fitting.criterion import cost
from bender_inference.fitting.output_error import Fitted
from bender_inference.search.noise import residual_square_um2
from bender_inference.search.result import SearchResult
from bender_report.wording import listed

REASON = "the search was interrupted; effects that it had not tried yet may replace this one or be missing beside it"


def partial_outcome(search: SearchResult, names: Sequence[str], searched: bool) -> dict[str, Any]:
    """Return what was ranked so far as `diagnosis.json` has it; no model was written, no FMU driven.

    Args:
        search: of the last complete step.
        names: of the records.
        searched: whether the search was complete, so that its verdict stands.
    """
    findings = find(search if searched else search.without_certainty(REASON))
    measured = _simulated(findings)
    result = outcome(findings.closing(measured), measured, names)
    if not searched:
        unsettled = [x | {"certain": False} for x in result["effects"]]
        result |= {"sentence": _sentence(search), "reason": REASON, "effects": unsettled, "complete": False}
    return {"partial": True} | result | {"model": None, "fmu": None, "ranking": ranking(search)}


def ranking(search: SearchResult) -> list[dict[str, Any]]:
    """Return the hypotheses that the search compared so far, each set of effects once, best first.

    Entries: effects in the order of adding, difference of the criterion to the best one, rms on held-out rows.
    """
    by = search.grades.by
    once: dict[frozenset[str], Fitted] = {}
    for x in search.archive.by_fit(x for x in search.archive.fits if x.hypothesis.parts):
        once.setdefault(frozenset(x.hypothesis.effects), x)
    ranked = sorted(once.values(), key=lambda x: cost(x, by))
    least = cost(ranked[0], by) if ranked else 0.0
    return [_entry(x, cost(x, by) - least, search) for x in ranked]


def _entry(fitted: Fitted, difference: float, search: SearchResult) -> dict[str, Any]:
    return {
        "effects": list(fitted.hypothesis.effects),
        "delta_bic": round(difference, 2) if math.isfinite(difference) else None,
        "rms_um": math.sqrt(residual_square_um2(search.problem, fitted, judged=True)),
    }


def _sentence(search: SearchResult) -> str:
    ranked = ranking(search)
    leader = listed([title_of(x) for x in ranked[0]["effects"]]) if ranked else "the model as given"
    return f"Interrupted: of what was ranked until then, {leader} fits best."


def _simulated(findings: Findings) -> Measured:
    """Return the gap at its three stages by simulation; the FMU would give the same to nanometres."""
    search = findings.search
    observations = search.problem.observations
    best = replace(search.best, calibration=findings.calibration)
    models = [corrected(search.base, best, record=k) for k in range(len(observations))]
    given = [Simulator(x.drive).run(search.base).reading_um for x in observations]
    after = [Simulator(x.drive).run(model).reading_um for x, model in zip(observations, models, strict=True)]
    recalibrated = after_calibration(search, given, given)
    measured = [np.where(x.usable, x.measured_um, np.nan) for x in observations]
    judged = [x.reporting for x in observations]
    before, alone_left, left = (gap(measured, simulated, judged) for simulated in (given, recalibrated, after))
    floor = math.hypot(search.archive.noise_um, search.sensor_step_um / math.sqrt(12.0))
    rows = sum(int(x.sum()) for x in judged)
    chance, chance_given = (chance_um2(search, floor, after, x, judged) for x in (recalibrated, given))
    is_corrected = findings.model is not search.base
    alone, corrected_left = ([x - y for x, y in zip(measured, z, strict=True)] for z in (recalibrated, after))
    closed = closed_part(alone, corrected_left, observations, floor)
    return Measured(
        before, alone_left, left, floor, given, recalibrated, after,
        judged=rows, by_chance_um2=chance, by_chance_given_um2=chance_given, closed=closed,
        is_corrected=is_corrected,
    )  # fmt: skip
