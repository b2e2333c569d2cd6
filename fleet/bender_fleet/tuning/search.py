"""Gains that serve many plants: the tuner's objective over the units themselves in place of an assumed ±30 %."""

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bender_fleet.tuning.plants import Opened, UnitPlant, median_unit
from bender_fleet.tuning.robust import FEWEST_FOR_TOLERANCE, Loops, tolerance_limit
from bender_loop.control.metrics import SETTLING_BAND, StepMetrics
from bender_loop.control.pid import Gains
from bender_loop.errors import RunError
from bender_loop.fmu.plant import FmuPlant
from bender_tuner.model.ensemble import EXTRA_FRAMES, GAIN_FACTORS, Case, Ensemble
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.margins import sensitivity_peak
from bender_tuner.rules.simc import FILTER_PERIODS, simc
from bender_tuner.task.experiment import StepExperiment
from bender_tuner.task.problem import TuningProblem, pose_problem, problem_of
from bender_tuner.task.settings import TuneSettings
from bender_tuner.task.tuning import run_search

_BROKEN, _UNSETTLED = 10.0, 8.0
"""A broken bound is worse than any settling; a unit that does not come to rest is worse than the slowest one."""
_WORST_SHARE = 0.7
"""Of the worst unit against the mean of all, as in the practitioner's objective."""
_HALVINGS, _RATIOS = 10, (0.03, 0.3, 1.0, 3.0, 10.0)
_SLOWED = (1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0)
"""Closed-loop times of SIMC that are tried, in parts of the delay: the first one is the rule's own choice."""
_EASED_MS, _EASINGS = 4.0, 5
"""How far a bound on Ms may give way, a modulus margin of a quarter, and in how many steps, even in log(Ms - 1)."""

Tell = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class UnitFigures:
    """One unit under one set of gains, the worse of the latency as told and one frame more.

    Attributes:
        unit: its name.
        sensitivity_peak: Ms; inf where the loop is unstable.
        settling_s: to 2 %; inf where it is not within the time allowed, or leaves the band again in as long a time.
        overshoot_percent: of the step.
    """

    unit: str
    sensitivity_peak: float
    settling_s: float
    overshoot_percent: float


@dataclass(frozen=True, slots=True, eq=False)
class Settling:
    """How units settle under one set of gains, the worse of two latencies each.

    Attributes:
        times: (n,) in parts of the time allowed; inf for a unit that does not come to rest.
        outside: (n,) share of the time behind that in which such a unit is out of the band; 0 for the others.
    """

    times: NDArray[np.float64]
    outside: NDArray[np.float64]

    @property
    def value(self) -> float:
        """What a search minimises: units that do not come to rest first, then the slowest of the others, their mean."""
        resting = self.times[np.isfinite(self.times)]
        lost = float(np.sum(np.isinf(self.times) * (1.0 + self.outside)))
        slowest, mean = (float(np.max(resting)), float(np.mean(resting))) if resting.size else (1.0, 1.0)
        return _UNSETTLED * lost / (1.0 + lost) + _WORST_SHARE * slowest + (1.0 - _WORST_SHARE) * mean

    def is_better_than(self, other: "Settling") -> bool:
        """Return whether as many units come to rest, and the slowest of those that both bring to rest sooner."""
        own, theirs = self._slowest_of_both(other)
        return self._resting >= other._resting and own < theirs

    def is_worse_than(self, other: "Settling") -> bool:
        """Return whether fewer units come to rest, or the slowest of those that both bring to rest later."""
        own, theirs = self._slowest_of_both(other)
        return self._resting < other._resting or own > theirs

    @property
    def _resting(self) -> int:
        return int(np.sum(np.isfinite(self.times)))

    def _slowest_of_both(self, other: "Settling") -> tuple[float, float]:
        both = np.isfinite(self.times) & np.isfinite(other.times)
        return float(np.max(self.times[both], initial=0.0)), float(np.max(other.times[both], initial=0.0))


class FleetObjective:
    """The settling of many units under a bound on Ms: call it with gains.

    Gains that break the bound, on a unit or in the tolerance limit of the population, are worse than all that keep it,
    by how far they break it; nothing is run for them. Of the others the value is the share of units that do not come to
    rest, and beside it the worst and the mean settling time.

    Attributes:
        max_ms: the bound.
    """

    def __init__(self, plants: Sequence[UnitPlant], settings: TuneSettings) -> None:
        """Set up a run for each unit, with the latency as told and with one frame more."""
        self.max_ms = settings.max_ms
        self._settings = settings
        self._loops = Loops([_delayed(x, settings, extra) for x in plants for extra in EXTRA_FRAMES])
        self._runs = [_run(x, settings, extra) for x in plants for extra in EXTRA_FRAMES]

    def limit(self, gains: Gains) -> float:
        """Return what the bound is put on: the tolerance limit of Ms, at least that of the worst unit.

        A few units do not tell how far the population spreads: each of them then counts with 30 % more gain.
        """
        few = len(self._runs) < FEWEST_FOR_TOLERANCE * len(EXTRA_FRAMES)
        peaks = self._loops.peaks(_scaled(gains, max(GAIN_FACTORS)) if few else gains)
        return tolerance_limit(np.max(peaks.reshape(-1, len(EXTRA_FRAMES)), axis=1))

    def within(self, max_ms: float) -> "FleetObjective":
        """Return the same under another bound."""
        other = copy.copy(self)
        other.max_ms = max_ms
        return other

    def keeps_bound(self, gains: Gains) -> bool:
        """Return whether Ms keeps its bound."""
        return self.limit(gains) <= self.max_ms

    def settling(self, gains: Gains) -> Settling:
        """Return how the units settle, whether or not the bound is kept."""
        told = np.array([_settling(x, gains, self._settings) for x in self._runs]).reshape(-1, len(EXTRA_FRAMES), 2)
        # the worse latency of each unit
        settling, outside = np.max(told, axis=1).T
        return Settling(settling / self._settings.duration_s, outside)

    def __call__(self, gains: Gains) -> float:
        """Return the value: below 10 where the bound is kept."""
        limit = self.limit(gains)
        if limit > self.max_ms:
            return _BROKEN + min(limit / self.max_ms, _BROKEN)
        return self.settling(gains).value


class Tuned(NamedTuple):
    """Gains tuned over units, the bound on Ms that they keep, and whether one set is enough for these units.

    It is where the bound did not give way, and the slowest unit settles no later than under the gains at the start.
    """

    gains: Gains
    max_ms: float
    is_enough: bool = True


def tuned_on(
    plants: Sequence[UnitPlant], start: Gains, settings: TuneSettings, tell: Tell, *, is_firm: bool = True
) -> Tuned:
    """Return gains tuned over units. They are never worse than `start` is once it is made slow enough for the bound.

    The search begins there, or at the largest integral gain that the bound allows, if that is better. A bound that is
    not firm gives way, step by step, where the slowest unit would settle later than under `start`: never as far as
    `start` breaks it.

    Raises:
        RunError: no gains hold the loop, or a plant failed.
    """
    objective = FleetObjective(plants, settings)
    problem = population_problem(plants, settings)
    gains = _within_bound(problem, objective, (start,), tell)
    theirs = objective.settling(start)
    ours = objective.settling(gains)
    found = Tuned(gains, settings.max_ms, not ours.is_worse_than(theirs))
    if is_firm or objective.keeps_bound(start) or ours.is_better_than(theirs):
        return found
    loosest = max(settings.max_ms, min(objective.limit(start), _EASED_MS))
    for bound in 1.0 + np.geomspace(settings.max_ms - 1.0, loosest - 1.0, _EASINGS + 1)[1:]:
        eased = objective.within(float(bound))
        gains = _within_bound(problem, eased, (start, found.gains), tell)
        if eased.settling(gains).is_better_than(theirs):
            return Tuned(gains, eased.max_ms, is_enough=False)
    return found


def _within_bound(problem: TuningProblem, objective: FleetObjective, starts: Sequence[Gains], tell: Tell) -> Gains:
    slowed = [_as_large_as_allowed(x, objective) for x in starts]
    begun = min((*slowed, _most_integral(starts[0], objective)), key=objective)
    title = f"tuning on the units, Ms at most {objective.max_ms:.3g}"
    return _searched(replace(problem, objective=objective, first_guess=begun), title, tell)


def _most_integral(start: Gains, objective: FleetObjective) -> Gains:
    """Return the gains with the largest Ki that keep the bound, over the ratios of Kp and Kd to Ki about `start`.

    It is the integral gain that rejects what is slow: drift, creep, a disturbance (Astrom, Panagopoulos and Hagglund,
    Design of PI controllers based on non-convex optimization, Automatica 34 (1998) 585-601).
    """
    ways = [
        replace(
            start,
            proportional_V_per_um=start.proportional_V_per_um * p,
            derivative_V_s_per_um=start.derivative_V_s_per_um * d,
        )
        for p in _RATIOS
        for d in _RATIOS
    ]
    return max((_as_large_as_allowed(x, objective) for x in ways), key=lambda x: x.integral_V_per_um_s)


def _as_large_as_allowed(gains: Gains, objective: FleetObjective) -> Gains:
    """Return gains in the same ratio, no larger, that keep the bound; the same ones where they keep it."""
    if objective.keeps_bound(gains):
        return gains
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if objective.keeps_bound(_scaled(gains, middle)) else (low, middle)
    return _scaled(gains, low or high)


def _scaled(gains: Gains, factor: float) -> Gains:
    return replace(
        gains,
        proportional_V_per_um=gains.proportional_V_per_um * factor,
        integral_V_per_um_s=gains.integral_V_per_um_s * factor,
        derivative_V_s_per_um=gains.derivative_V_s_per_um * factor,
    )


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


def own_gains(unit: UnitPlant, settings: TuneSettings, max_ms: float) -> tuple[Gains, UnitFigures] | None:
    """Return gains for one unit alone and what they do: SIMC's, slowed until they keep the bound and bring it to rest.

    None where none of them does.
    """
    filter_s = FILTER_PERIODS * settings.sampling.period_s
    for slowed in _SLOWED:
        gains = simc(unit.reduced, closed_loop_time_s=slowed * unit.reduced.delay_s, filter_time_s=filter_s)
        told = _figures(gains, unit, settings)
        if told.sensitivity_peak <= max_ms and math.isfinite(told.settling_s):
            return gains, told
    return None


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
    peaks, settling, overshoot = [], [], []
    for extra in EXTRA_FRAMES:
        peaks.append(sensitivity_peak(gains, _delayed(unit, settings, extra)))
        run = _run(unit, settings, extra)
        metrics = run.metrics(run.run(gains))
        settling.append(_settled(metrics, settings))
        overshoot.append(metrics.overshoot_percent)
    return UnitFigures(unit.name, max(peaks), max(settling), max(overshoot))


def _delayed(unit: UnitPlant, settings: TuneSettings, extra: int) -> DelayedPlant:
    return DelayedPlant(unit.linearisation.model, settings.latency_frames + extra)


def _run(unit: UnitPlant, settings: TuneSettings, extra: int) -> StepExperiment:
    """Return a step that goes on as long again as the settling may take: what leaves the band again has not settled."""
    experiment = replace(_experiment(unit, settings), duration_s=2.0 * settings.duration_s)
    return experiment.with_plant(unit.plant, settings.latency_frames + extra)


def _settling(run: StepExperiment, gains: Gains, settings: TuneSettings) -> tuple[float, float]:
    """Return the settling time, inf where it never comes to rest, and the share of the second half out of the band."""
    trace = run.run(gains)
    settling_s = _settled(run.metrics(trace), settings)
    if math.isfinite(settling_s) or trace.diverged:
        return settling_s, 0.0 if math.isfinite(settling_s) else 1.0
    late = trace.time_s >= settings.duration_s
    return settling_s, float(np.mean(np.abs(trace.displacement_um[late] / settings.setpoint_um - 1.0) > SETTLING_BAND))


def _settled(metrics: StepMetrics, settings: TuneSettings) -> float:
    return metrics.settling_time_s if metrics.settling_time_s <= settings.duration_s else math.inf
