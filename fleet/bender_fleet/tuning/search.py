"""Gains that serve many plants: the tuner's objective over the units themselves in place of an assumed ±30 %."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bender_fleet.tuning.plants import Opened, UnitPlant, median_unit
from bender_loop.control.pid import Gains
from bender_loop.errors import RunError
from bender_loop.fmu.plant import FmuPlant
from bender_tuner.model.ensemble import EXTRA_FRAMES, Case, Ensemble
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.margins import sensitivity_peak
from bender_tuner.rules.simc import FILTER_PERIODS, simc
from bender_tuner.task.experiment import StepExperiment
from bender_tuner.task.problem import TuningProblem, pose_problem, problem_of
from bender_tuner.task.settings import TuneSettings
from bender_tuner.task.tuning import run_search

Tell = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class UnitFigures:
    """One unit under one set of gains, the worse of the latency as told and one frame more.

    Attributes:
        unit: its name.
        sensitivity_peak: Ms; inf where the loop is unstable.
        settling_s: to 2 %; inf where it does not settle in the run.
        overshoot_percent: of the step.
    """

    unit: str
    sensitivity_peak: float
    settling_s: float
    overshoot_percent: float


def tuned_on(plants: Sequence[UnitPlant], settings: TuneSettings, tell: Tell) -> Gains:
    """Return gains tuned over units, worst and mean of them weighed as the practitioner's objective weighs its cases.

    Raises:
        RunError: no gains hold the loop, or a plant failed.
    """
    return _searched(population_problem(plants, settings), "tuning on the units", tell)


def tuned_on_nominal(fmu: Path, settings: TuneSettings, tell: Tell) -> Gains:
    """Return gains tuned as `bender tune` does: the nominal model with its gain 30 % up and down.

    Raises:
        InputError: the setpoint is out of its reach.
        RunError: no gains hold the loop, or the plant failed.
    """
    plant = FmuPlant(fmu)
    try:
        return _searched(pose_problem(plant, settings), "tuning on the nominal model", tell)
    finally:
        plant.close()


def population_problem(plants: Sequence[UnitPlant], settings: TuneSettings) -> TuningProblem:
    """Return the tuning problem whose cases are units, each with the latency as told and one frame more."""
    nominal = median_unit(plants)
    cases = {
        (x.name, extra): Case(
            1.0,
            settings.latency_frames + extra,
            x.plant,
            x.linearisation,
            DelayedPlant(x.linearisation.model, settings.latency_frames + extra),
        )
        for x in plants
        for extra in EXTRA_FRAMES
    }
    ensemble = Ensemble(cases[nominal.name, 0], tuple(cases.values()))
    return problem_of(_experiment(nominal, settings), ensemble, settings)


def figures(gains: Gains, plants: Sequence[UnitPlant], settings: TuneSettings) -> list[UnitFigures]:
    """Return what gains do to units."""
    return [_figures(gains, x, settings) for x in plants]


def servable(fleet: Opened, settings: TuneSettings) -> Opened:
    """Return the fleet without the units that not even gains of their own bring to rest at the setpoint.

    Their own gains are those of SIMC, the closed formula for the unit's own gain, lag and delay: a unit that swings by
    itself, or whose supply is too slow, is not made better by a compromise with others.
    """
    kept, unserved = [], dict(fleet.unserved)
    for x in fleet.plants:
        own = simc(x.reduced, filter_time_s=FILTER_PERIODS * settings.sampling.period_s)
        told = _figures(own, x, settings)
        if math.isfinite(told.settling_s) and math.isfinite(told.sensitivity_peak):
            kept.append(x)
        else:
            unserved[x.name] = f"not even gains of its own (SIMC) bring it to rest within {settings.duration_s:g} s"
    return Opened(tuple(kept), unserved)


def quantiles(values: Sequence[float]) -> dict[str, float]:
    """Return median, 95 % and worst; a unit without a finite value counts as the worst."""
    ordered = np.sort(np.array(values))
    places = {"median": 0.5, "q95": 0.95, "worst": 1.0}
    return {name: float(ordered[min(math.ceil(q * ordered.size), ordered.size) - 1]) for name, q in places.items()}


def _experiment(unit: UnitPlant, settings: TuneSettings) -> StepExperiment:
    return StepExperiment(
        unit.plant, settings.limits, settings.setpoint_um, settings.sampling, settings.duration_s, seed=settings.seed
    )


def _searched(problem: TuningProblem, title: str, tell: Tell) -> Gains:
    found = run_search(problem, problem.settings.method, on_evaluation=lambda done, total, _: tell(title, done, total))
    if found.ended.value == "interrupted":
        raise KeyboardInterrupt
    if found.gains is None:
        raise RunError(f"{title}: no gains hold all loops in {len(found.history)} evaluations; {found.reason}")
    return found.gains


def _figures(gains: Gains, unit: UnitPlant, settings: TuneSettings) -> UnitFigures:
    experiment = _experiment(unit, settings)
    peaks, settling, overshoot = [], [], []
    for extra in EXTRA_FRAMES:
        latency = settings.latency_frames + extra
        peaks.append(sensitivity_peak(gains, DelayedPlant(unit.linearisation.model, latency)))
        run = experiment.with_plant(unit.plant, latency)
        metrics = run.metrics(run.run(gains))
        settling.append(math.inf if math.isnan(metrics.settling_time_s) else metrics.settling_time_s)
        overshoot.append(metrics.overshoot_percent)
    return UnitFigures(unit.name, max(peaks), max(settling), max(overshoot))
