"""The content of `diagnosis.json`."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from bender_discrepancy.conclusion.contenders import alternatives
from bender_discrepancy.conclusion.findings import Findings, RecalibratedNumber, ReportedEffect, worst_record
from bender_discrepancy.conclusion.localise import residual_ranges
from bender_discrepancy.conclusion.measurement.corrected_model import Gap
from bender_discrepancy.conclusion.measurement.gap import Measured
from bender_discrepancy.conclusion.notes import (
    MOST_LISTED,
    elsewhere,
    excitation_of,
    more_than_noise,
    not_written,
    row_of_file,
    set_aside,
    warnings,
)
from bender_discrepancy.conclusion.sentences import evidence, heading_of, headline, reason
from bender_discrepancy.conclusion.shares import EQUATION, OWN_NUMBERS, held_square_um2
from bender_effects.catalogue import EFFECTS
from bender_inference.equation.lead import Lead
from bender_inference.experiment.proposal import Proposal
from bender_inference.records.record_names import distinct_names
from bender_inference.search.judgement.probability import Case
from bender_inference.search.noise import as_read, floor_square_um2
from bender_inference.search.result import SearchResult
from bender_inference.witnesses.missing_columns import MissingColumn
from bender_loop.tables.quantities import MICROMETRE, USUAL, Quantities
from bender_plant.blocks import residual_equation
from bender_report.number import Number
from bender_report.wording import relabelled, unit_name

# what a place on these axes says needs true times
TIMED_AXES = ("time", "rate", "hold", "frequency")
SPARSE_EQUATION = "sparse_equation"
"""What the contract calls an equation without a name."""
MODEL, FMU = "model.toml", "model.fmu"


def is_written(findings: Findings, measured: Measured) -> bool:
    """Return whether there is a corrected model to write.

    Not a worse one, nor one of another device, nor one whose effects or numbers held-out readings do not show to close
    any of the gap; one of another gain and offset alone may always be.
    """
    if measured.is_worse or findings.is_another_device:
        return False
    return not (findings.is_corrected and measured.is_unproved)


def outcome(
    findings: Findings,
    measured: Measured,
    names: Sequence[str] = (),
    next_experiment: Proposal | None = None,
    lead: Lead | None = None,
    missing_columns: Sequence[MissingColumn] = (),
) -> dict[str, Any]:
    """Return the diagnosis as `diagnosis.json` has it; every number in it is finite or null.

    Args:
        findings: what is told.
        measured: the gap at its three stages.
        names: of the records or their files, for the entry `records`.
        next_experiment: None where none is needed or known.
        lead: an equation for the residual, or why there is none; None where none was asked for.
        missing_columns: what could be recorded as well.
    """
    search = findings.search
    return {
        "verdict": findings.verdict,
        "sentence": headline(findings, measured),
        "complete": findings.complete,
        "reason": reason(findings, measured),
        "start": [x.start for x in search.problem.observations],
        "start_input": [x.rest_before_V for x in search.problem.observations],
        "effects": [*(_effect(findings, measured, x) for x in findings.effects), *_equation(findings)],
        "alternatives": [
            {"effects": list(x.effects), "closes": round(x.closes, 4)} for x in alternatives(search, findings.verdict)
        ],
        "recalibrated": {x.name: _change(x) for x in findings.recalibrated},
        "refitted": {x.name: _change(x) for x in findings.changed},
        "where": _where(findings),
        "gap": {
            "before": _gap(measured.before),
            "recalibrated": _gap(measured.recalibrated),
            "after": _gap(measured.after),
            "noise_floor_um": _finite(measured.floor_um),
            "closed": None if measured.closes is None else round(measured.closes, 4),
            "closed_std": None if measured.closes is None else round(measured.closed[1], 4),
            "closed_by_own_numbers": round(findings.shares[OWN_NUMBERS], 4) if OWN_NUMBERS in findings.shares else None,
            "held_out": True,
        },
        "next_experiment": next_experiment.to_dict() if next_experiment else None,
        "columns_that_would_tell": [x.to_dict() for x in missing_columns],
        "lead": _lead(findings, lead),
        "no_lead": (lead.reason or None) if lead else None,
        "model": MODEL if is_written(findings, measured) else None,
        "fmu": FMU if is_written(findings, measured) else None,
        "model_of_record": findings.of_record,
        "sensor_step_um": search.sensor_step_um or None,
        "exposure_s": _exposure_s(search),
        "warnings": [
            *not_written(findings, measured),
            *elsewhere(search, measured),
            *more_than_noise(findings, measured),
            *warnings(findings),
        ],
        "records": _records(findings, names),
        "settings": {
            "base_model": search.base.name,
            "input_hold": search.settings.input_hold,
            "untimed": search.settings.untimed,
            "same_zero": search.settings.same_zero,
        },
    }


def _exposure_s(search: SearchResult) -> float | None:
    """Return the exposure of every frame; None where it is not known, or not the same in all records."""
    known = {record.exposure for record in search.records}
    return max(known) or None if len(known) == 1 else None


def in_own_units(told: dict[str, Any], quantities: Quantities) -> dict[str, Any]:
    """Return the content with the gap in the record's own unit as well, and every unit under its own name.

    Keys that end with `_um` stay for micrometres: of another quantity they are null.
    """
    unit = quantities.reading
    gap = told["gap"]
    for stage in {"before", "recalibrated", "after"} & set(gap):
        gap[stage]["rms"] = gap[stage]["rms_um"]
    gap["noise_floor"] = gap["noise_floor_um"]
    told = told | {"unit": unit, "input_unit": quantities.command}
    return told if quantities[:2] == USUAL[:2] else _renamed(told, unit != MICROMETRE)


def _renamed(value: Any, without_um: bool, key: str = "") -> Any:
    if isinstance(value, dict):
        return {x: _renamed(y, without_um, x) for x, y in value.items()}
    if isinstance(value, list):
        return [_renamed(x, without_um, key) for x in value]
    if isinstance(value, str):
        return unit_name(value) if key in ("unit", "between_unit") else relabelled(value)
    outside = key in ("rms_um", "all_rms_um", "noise_floor_um", "difference_um", "sensor_step_um")
    return None if without_um and outside else value


def _effect(findings: Findings, measured: Measured, effect: ReportedEffect) -> dict[str, Any]:
    about = EFFECTS[effect.id]
    x = effect.contender
    entry: dict[str, Any] = {
        "id": effect.id,
        "title": heading_of(effect.id),
        "stage": about.stage,
        "certain": effect in findings.certain,
        "grade": effect.grade,
        "probability": round(effect.probability, 3),
        "belongs_to": "record" if about.of_the_record else "device",
        "parameters": {number.name: _parameter(number) for number in effect.numbers},
        "evidence": evidence(findings, effect),
        "share_of_gap": round(effect.share_of_gap, 4),
        "rivals": [{"id": r.id, "delta_bic": _finite(round(r.difference, 2))} for r in (x.rivals if x else ())],
    }
    if x is not None:
        entry["delta_bic_without"] = _finite(round(x.without, 2))
        entry["weighed"] = None if x.case is None else _weighed(x.case)
    elif findings.lattice is not None and measured.floor_um > 0.0:
        entry["share_of_noise_floor"] = round(min((findings.lattice.share_um / measured.floor_um) ** 2, 1.0), 4)
    if effect.form:
        entry["form"] = effect.form
    if effect.by_record:
        entry["record"] = findings.of_record
        entry["parameters_by_record"] = [{x.name: _parameter(x) for x in numbers} for numbers in effect.by_record]
    if x is not None and x.rival_of:
        entry["rival_of"] = x.rival_of
    return entry


def _weighed(case: Case) -> dict[str, float | bool]:
    return {k: x if isinstance(x, bool) else round(x, 4) for k, x in asdict(case).items()}


def _lead(findings: Findings, lead: Lead | None) -> dict[str, Any] | None:
    told = lead.to_dict() if lead else None
    return told and told | {"in_model": findings.search.best.hypothesis.equation is not None}


def _equation(findings: Findings) -> list[dict[str, Any]]:
    """Return the equation without a name that the corrected model has, as an entry beside the effects."""
    part = findings.search.best.hypothesis.equation
    if part is None:
        return []
    block = next(x.parameters for x in findings.model.blocks if x.id == residual_equation.ID)
    return [
        {
            "id": SPARSE_EQUATION,
            "title": residual_equation.TITLE,
            "stage": residual_equation.STAGE,
            "certain": False,
            "grade": "possible",
            "probability": None,
            "belongs_to": "device",
            "parameters": {
                x.name: {"value": v, "unit": "1", "std": None, "interval_95": None}
                for x, v in zip(part.form.free, part.values, strict=True)
            },
            "terms": list(block.terms),
            "gives": block.gives,
            "valid": {
                "voltage_V": [block.lowest_voltage_V, block.highest_voltage_V],
                "displacement_um": [block.lowest_displacement_um, block.highest_displacement_um],
                "residual_um": block.largest_residual_um,
            },
            "evidence": (
                "An equation without a name: with it the model predicts blocks that its fit did not see better than "
                "with anything of the catalogue. Outside of what the records covered it stops at the ends of that."
            ),
            "share_of_gap": round(findings.shares.get(EQUATION, 0.0), 4),
            "rivals": [],
        }
    ]


def _parameter(number: Number) -> dict[str, Any]:
    entry: dict[str, Any] = {"value": number.value, "unit": number.unit, "std": _finite(number.std)}
    entry["interval_95"] = list(number.interval) if number.interval else None
    if number.typical is not None:
        entry["typical"] = list(number.typical)
        entry["unusual"] = number.unusual
    return entry


def _change(changed: RecalibratedNumber) -> dict[str, Any]:
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
    search = findings.search
    base, observations = search.found.base, search.problem.observations
    worst = worst_record(search)
    if held_square_um2(base, search.problem) == 0.0:
        return []
    left = as_read(search.problem, base) or base.residuals
    floor_um = math.sqrt(floor_square_um2(search.problem, search.archive.noise_um))
    found = [x.to_dict() for x in residual_ranges(observations[worst], left[worst], floor_um)]
    if search.settings.untimed:
        found = [x for x in found if x["axis"] not in TIMED_AXES]
    return [x | {"record": worst} for x in found] if len(observations) > 1 else found


def _records(findings: Findings, names: Sequence[str]) -> list[dict[str, Any]]:
    search = findings.search
    known = distinct_names(names) or [f"record {k + 1}" for k in range(len(search.records))]
    found = []
    searched = search.searched
    told = zip(known, excitation_of(search), set_aside(search), searched, search.records, strict=True)
    for name, words, aside, rows, record in told:
        found.append(
            {
                "name": name,
                "rows": aside.rows,
                "searched_rows": [row_of_file(record, int(rows[k])) for k in (0, -1)],
                "lost": aside.lost,
                "outlying": len(aside.outlying),
                "outlying_rows": list(aside.outlying[:MOST_LISTED]),
                "excitation": words,
            }
        )
    return found


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
