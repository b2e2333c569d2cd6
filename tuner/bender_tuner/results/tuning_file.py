"""`tuning.json`: what was asked, what was run, what came of it, enough to run it again."""

import hashlib
import math
import platform
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from bender_loop.control.metrics import StepMetrics
from bender_loop.control.pid import Gains
from bender_loop.fmu.diagnosed import Known
from bender_loop.fmu.file import read_description
from bender_loop.fmu.plant import FmuPlant
from bender_loop.fmu.ports import DEFAULT_UNITS
from bender_loop.fmu.process.watched import WatchedPlant
from bender_loop.shell.files import result_text
from bender_loop.tables.quantities import MICROMETRE, USUAL, VOLT, Quantities, shown
from bender_tuner.model.monte_carlo import MonteCarloResult
from bender_tuner.results.report import json_ready
from bender_tuner.rules.gain_forms import to_discrete, to_isa
from bender_tuner.rules.ziegler_nichols import ZieglerNichols
from bender_tuner.task.contenders import Contender
from bender_tuner.task.judgement import Judgement
from bender_tuner.task.practitioner import PractitionerReport
from bender_tuner.task.problem import OBJECTIVE_UNITS, TuningProblem
from bender_tuner.task.recommendation import Recommendation
from bender_tuner.task.tuning import SearchResult

_NOT_OF_THE_FILE = "parameters", "quantities", "model_rms_um", "known", "known_by", "unlikely_rivals"
_DISTRIBUTIONS = ("piezo-bender", "numpy", "scipy", "fmpy")


@dataclass(frozen=True, slots=True)
class FmuFacts:
    """Which FMU was tuned.

    Attributes:
        path: of the FMU; `model_name`, `guid`, `input`, `output` and `parameters` are the names in it.
        sha256: of the file.
        start_values: of its parameters that were set.
        taken_units: those of variables for which it declares none.
        quantities: of what is commanded and read.
        units: the units of both in sentences and pictures: "V" and "um", or those that the FMU declares.
        model_rms_um: its residual on held-out rows, from the diagnosis beside it; 0 without a diagnosis.
        known: how well it bounds the device; None where it does not.
        known_by: by which file and which numbers, or why not.
        unlikely_rivals: models that it leaves open, but for which no gains need hold.
    """

    path: str
    model_name: str
    guid: str
    sha256: str
    input: str
    output: str
    parameters: tuple[str, ...]
    start_values: dict[str, float] = field(default_factory=dict)
    taken_units: dict[str, str] = field(default_factory=dict)
    quantities: Quantities = USUAL
    units: tuple[str, str] = (VOLT, MICROMETRE)
    model_rms_um: float = 0.0
    known: Known | None = None
    known_by: str = ""
    unlikely_rivals: tuple[str, ...] = ()


def fmu_facts(path: Path, plant: FmuPlant | WatchedPlant, quantities: Quantities = USUAL) -> FmuFacts:
    """The facts of the FMU that `plant` has open, with the units that were stated."""
    description = read_description(path)
    taken = zip((plant.input, plant.output), quantities.stated, DEFAULT_UNITS, strict=True)
    return FmuFacts(
        path=str(path),
        model_name=str(description.modelName),
        guid=str(description.guid),
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        input=plant.input.name,
        output=plant.output.name,
        parameters=tuple(v.name for v in description.modelVariables if v.causality == "parameter"),
        quantities=quantities,
        units=(
            plant.input.stands_for or shown(plant.input.unit, quantities.command, VOLT),
            plant.output.stands_for or shown(plant.output.unit, quantities.reading, MICROMETRE),
        ),
        taken_units={port.name: stated or usual for port, stated, usual in taken if port.unit is None},
    )


def tuning_document(
    problem: TuningProblem,
    fmu: FmuFacts,
    searches: Iterable[SearchResult],
    contenders: Iterable[Contender],
    ziegler_nichols: ZieglerNichols,
    *,
    status: str,
    reason: str,
    model_following: Recommendation | None = None,
) -> str:
    """The whole file; a number that JSON has no word for is null."""
    contenders = list(contenders)
    document = {
        "status": status,
        "reason": reason,
        "settings": asdict(problem.settings),
        "fmu": {key: value for key, value in asdict(fmu).items() if key not in _NOT_OF_THE_FILE},
        "versions": _versions(),
        "operating_point": asdict(problem.operating_point),
        "reduced_model": asdict(problem.reduced),
        "notes": problem.notes,
        "objective": {"name": problem.settings.objective, "unit": OBJECTIVE_UNITS[problem.settings.objective]},
        "best": _contender(contenders[0], problem),
        "others": [_contender(contender, problem) for contender in contenders[1:]],
        "model_following": None if model_following is None else _recommendation(model_following),
        "ziegler_nichols": _rule(ziegler_nichols),
        "history": {run.method: _history(run) for run in searches},
    }
    return result_text(json_ready(document), indent=1)


def gain_forms(gains: Gains, period_s: float) -> dict[str, Any]:
    """Parallel, ISA (None where there is none) and discrete form."""
    isa = to_isa(gains)
    return {
        "parallel": asdict(gains),
        "isa": None if isa is None else asdict(isa),
        "discrete": asdict(to_discrete(gains, period_s)),
    }


def monte_carlo_figures(result: MonteCarloResult) -> dict[str, Any]:
    """Counts and quantiles; an infinite time means that the run never settled."""
    return {
        "plants": len(result.outcomes),
        "unstable": result.unstable,
        "unsettled": sum(math.isnan(outcome.metrics.settling_time_s) for outcome in result.outcomes),
        "settling_time_median_s": result.quantile("settling_time_s", 0.5),
        "settling_time_95_percent_s": result.quantile("settling_time_s", 0.95),
        "overshoot_95_percent_percent": result.quantile("overshoot_percent", 0.95),
    }


def _contender(contender: Contender, problem: TuningProblem) -> dict[str, Any]:
    about: dict[str, Any] = {"method": contender.method, "label": contender.label, "remark": contender.remark}
    if contender.gains is not None:
        about |= gain_forms(contender.gains, problem.settings.sampling.period_s)
    if contender.judgement is not None:
        about |= _judgement(contender.judgement)
    if contender.monte_carlo is not None:
        about["monte_carlo"] = monte_carlo_figures(contender.monte_carlo)
    return about


def _judgement(judgement: Judgement) -> dict[str, Any]:
    return {
        "objective_value": judgement.value,
        "step": _step(judgement.metrics),
        "step_at_frames": _step(judgement.at_frames),
        "bounds_kept": judgement.practitioner.bounds_kept,
        "practitioner": _practitioner(judgement.practitioner),
        "robustness": judgement.robustness.to_dict(),
    }


def _practitioner(report: PractitionerReport) -> dict[str, Any]:
    return {
        "value": report.value,
        "tracking": report.tracking,
        "penalty": report.penalty,
        "cases": [
            {
                "gain_factor": case.gain_factor,
                "latency_frames": case.latency_frames,
                "rival": case.rival,
                "score": case.score,
                "sensitivity_peak": case.sensitivity_peak,
                "step": _step(case.metrics),
            }
            for case in report.cases
        ],
    }


def _recommendation(found: Recommendation) -> dict[str, Any]:
    """Whether a model is followed, with what decided it."""
    models = [x.following.model for x in found.tried]
    return {
        "recommended": found.following is not None,
        "sentence": found.sentence,
        "judged_with": {
            "gain_error_percent": found.device.gain_error_percent,
            "late_frames": found.device.late_frames,
            "by": "diagnosis" if found.device.by_diagnosis else "settings",
        },
        "scores": [
            {"method": x.method, "label": x.label, "nominal_rms_um": x.rms_um, "bounds_kept": x.report.bounds_kept}
            | _practitioner(x.report)
            for x in found.scores
        ],
        "tried": {
            "rate_um_per_s": [x.rate_um_per_s for x in models],
            "curvature_um_per_s2": [x.curvature_um_per_s2 for x in models],
            "horizon_ticks": [x.horizon_ticks for x in models],
            "value": [x.value for x in found.tried],
            "nominal_rms_um": [x.nominal_rms_um for x in found.tried],
            "bounds_kept": [x.bounds_kept for x in found.tried],
        },
    }


def _step(metrics: StepMetrics) -> dict[str, Any]:
    return asdict(metrics)


def _rule(found: ZieglerNichols) -> dict[str, Any]:
    return {
        "well_posed": found.well_posed,
        "verdict": found.verdict.name.lower(),
        "sentence": found.sentence,
        "linear": None if found.linear is None else asdict(found.linear),
        "relay": None if found.relay is None else asdict(found.relay),
    }


def _history(run: SearchResult) -> dict[str, Any]:
    """Columns, one entry per evaluation."""
    gains = [evaluation.gains for evaluation in run.history]
    return {
        "ended": run.ended.value,
        "budget": run.budget,
        "proportional_V_per_um": [None if g is None else g.proportional_V_per_um for g in gains],
        "integral_V_per_um_s": [None if g is None else g.integral_V_per_um_s for g in gains],
        "derivative_V_s_per_um": [None if g is None else g.derivative_V_s_per_um for g in gains],
        "value": [evaluation.value for evaluation in run.history],
        "best": [evaluation.best for evaluation in run.history],
    }


def _versions() -> dict[str, str]:
    versions = {"python": platform.python_version()}
    for name in _DISTRIBUTIONS:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return versions
