"""The content of `diagnosis.json`."""

import math
from collections.abc import Sequence
from typing import Any

from bender_discrepancy.conclusion.contenders import held_square_um2
from bender_discrepancy.conclusion.corrected_model import Gap
from bender_discrepancy.conclusion.findings import Changed, Findings, Named, worst_record
from bender_discrepancy.conclusion.gap import Measured
from bender_discrepancy.conclusion.localise import places
from bender_discrepancy.conclusion.notes import (
    MOST_LISTED,
    elsewhere,
    excitation_of,
    more_than_noise,
    set_aside,
    warnings,
    worse,
)
from bender_discrepancy.conclusion.sentences import evidence, headline
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.equation.lead import Lead
from bender_report.number import Number

# what a place on these axes says needs true times
TIMED_AXES = ("time", "rate", "hold", "frequency")
MODEL, FMU = "model.toml", "model.fmu"


def outcome(
    findings: Findings,
    measured: Measured,
    names: Sequence[str] = (),
    next_experiment: dict[str, Any] | None = None,
    lead: Lead | None = None,
) -> dict[str, Any]:
    """Return the diagnosis as `diagnosis.json` has it; every number in it is finite or null.

    Args:
        findings: what is told.
        measured: the gap at its three stages.
        names: of the records, for the entry `records`.
        next_experiment: {"why": sentence, "profile": file name, …}; None where none is needed or known.
        lead: an equation for what is left, or why there is none; None where none was asked for.
    """
    diagnosis = findings.diagnosis
    return {
        "verdict": findings.verdict,
        "sentence": headline(findings),
        "complete": diagnosis.verdict.complete,
        "reason": diagnosis.verdict.reason,
        "start": [x.start for x in diagnosis.problem.observations],
        "effects": [_effect(findings, x) for x in findings.effects],
        "recalibrated": {x.name: _change(x) for x in findings.recalibrated},
        "where": _where(findings),
        "gap": {
            "before": _gap(measured.before),
            "recalibrated": _gap(measured.recalibrated),
            "after": _gap(measured.after),
            "noise_floor_um": _finite(measured.floor_um),
            "held_out": True,
        },
        "next_experiment": next_experiment,
        "lead": lead.to_dict() if lead else None,
        "no_lead": (lead.reason or None) if lead else None,
        "model": None if measured.is_worse else MODEL,
        "fmu": None if measured.is_worse else FMU,
        "model_of_record": findings.of_record,
        "sensor_step_um": diagnosis.sensor_step_um or None,
        "warnings": [
            *worse(measured),
            *elsewhere(diagnosis, measured),
            *more_than_noise(findings, measured),
            *warnings(findings),
        ],
        "records": _records(findings, names),
        "settings": {
            "base_model": diagnosis.base.name,
            "input_hold": "linear" if diagnosis.settings.linear else "hold",
            "untimed": diagnosis.settings.untimed,
        },
    }


def _effect(findings: Findings, effect: Named) -> dict[str, Any]:
    about = EFFECTS[effect.id]
    x = effect.contender
    shared = x or findings.lattice
    entry: dict[str, Any] = {
        "id": effect.id,
        "title": about.title,
        "stage": about.stage,
        "parameters": {number.name: _parameter(number) for number in effect.numbers},
        "evidence": evidence(findings, effect),
        "share_of_gap": round(shared.share_of_gap if shared else 0.0, 4),
        "rivals": [{"id": r.id, "delta_bic": round(r.difference, 2)} for r in (x.rivals if x else ())],
    }
    if x is not None:
        entry["delta_bic_without"] = round(x.without, 2)
    if effect.form:
        entry["form"] = effect.form
    if effect.by_record:
        entry["record"] = findings.of_record
        entry["parameters_by_record"] = [{x.name: _parameter(x) for x in numbers} for numbers in effect.by_record]
    if x is not None and x.rival_of:
        entry["rival_of"] = x.rival_of
    return entry


def _parameter(number: Number) -> dict[str, Any]:
    entry: dict[str, Any] = {"value": number.value, "unit": number.unit, "std": _finite(number.std)}
    if number.typical is not None:
        entry["typical"] = list(number.typical)
        entry["unusual"] = number.unusual
    return entry


def _change(changed: Changed) -> dict[str, Any]:
    entry = {"before": changed.before, "after": changed.after, "unit": changed.unit, "std": _finite(changed.std)}
    return entry | {"after_by_record": list(changed.afters)} if changed.afters else entry


def _gap(gap: Gap) -> dict[str, float | None]:
    return {
        "rms_um": _finite(gap.rms_um),
        "nrmse_percent": _finite(gap.nrmse_percent),
        "all_rms_um": _finite(gap.all_rms_um),
    }


def _where(findings: Findings) -> list[dict[str, Any]]:
    """Return where the recalibrated model disagrees, in the record in which it does most; nowhere with noise alone."""
    if findings.verdict in ("no_gap", "recalibrated"):
        return []
    diagnosis = findings.diagnosis
    base, observations = diagnosis.found.base, diagnosis.bench.observations
    worst = worst_record(diagnosis)
    if held_square_um2(base, diagnosis.bench) == 0.0:
        return []
    found = [x.to_dict() for x in places(observations[worst], base.residuals[worst], diagnosis.found.noise_um)]
    if diagnosis.settings.untimed:
        found = [x for x in found if x["axis"] not in TIMED_AXES]
    return [x | {"record": worst} for x in found] if len(observations) > 1 else found


def _records(findings: Findings, names: Sequence[str]) -> list[dict[str, Any]]:
    diagnosis = findings.diagnosis
    known = list(names) or [f"record {k + 1}" for k in range(len(diagnosis.records))]
    found = []
    searched = diagnosis.searched
    for name, words, aside, rows in zip(known, excitation_of(diagnosis), set_aside(diagnosis), searched, strict=True):
        found.append(
            {
                "name": name,
                "rows": aside.rows,
                "searched_rows": [rows.start, rows.stop - 1],
                "lost": aside.lost,
                "outlying": len(aside.outlying),
                "outlying_rows": list(aside.outlying[:MOST_LISTED]),
                "excitation": words,
            }
        )
    return found


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
