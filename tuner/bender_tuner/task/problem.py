"""A plant and settings made into a tuning problem: what is run, what is minimised, where the search begins."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from bender_loop.control.pid import Gains
from bender_loop.control.plant import Plant, restart
from bender_loop.errors import InputError
from bender_tuner.model.ensemble import Ensemble, Rival, build_ensemble
from bender_tuner.model.linear_model import (
    DEAD_TIME_S,
    FEWEST_FRAMES,
    MOST_FRAMES,
    OperatingPoint,
    find_operating_point,
    settle,
)
from bender_tuner.model.margins import sensitivity_peak
from bender_tuner.model.reduced_model import ReducedModel, reduce_model
from bender_tuner.rules.simc import first_guess
from bender_tuner.task.experiment import StepExperiment
from bender_tuner.task.objectives import Objective, itae, mean_squared_error
from bender_tuner.task.practitioner import PractitionerObjective, Priorities
from bender_tuner.task.search_space import SHORT_NAMES, GainSpace, RawSpace, SearchSpace
from bender_tuner.task.settings import WEIGHTS, TuneSettings

_CLEARANCE = 2e-3
SMALL_SETPOINT = 300.0
"""From this many times the setpoint on, what a plant travels is asked about."""
_MS_COMFORT = 6.0 / 7.0
_RUNS_WAITED = 5.0
_STARTS_WITHIN, _MOST_HALVINGS = 2.0, 24
"""A search starts where the worst Ms is at most this many times its bound."""
OBJECTIVE_UNITS = {"practitioner": "1", "mse": "um^2", "itae": "um s^2"}


Report = Callable[[str, int, int, str], None]
"""Told what is being done, how many units of how many are done, and a remark."""


@dataclass(frozen=True, slots=True, eq=False)
class TuningProblem:
    """What every method is given.

    Attributes:
        settings: as asked for.
        experiment: the nominal step.
        ensemble: the plants that a tuning must hold for.
        practitioner: the practitioner's objective, the judge of all gains whatever was minimised.
        objective: what the searches minimise.
        reduced: gain, lag and delay of the nominal loop.
        first_guess: where the searches begin.
        notes: sentences about what is unusual.
    """

    settings: TuneSettings
    experiment: StepExperiment
    ensemble: Ensemble
    practitioner: PractitionerObjective
    objective: Objective
    reduced: ReducedModel
    first_guess: Gains
    notes: tuple[str, ...]

    @property
    def operating_point(self) -> OperatingPoint:
        """Where the nominal plant rests at the setpoint."""
        return self.ensemble.nominal.linearisation.point

    def keeps_bounds(self, gains: Gains) -> bool:
        """Return whether the gains keep every bound of the practitioner."""
        return self.practitioner.evaluate(gains).bounds_kept

    def holds(self, gains: Gains) -> bool:
        """Return whether the nominal loops, those of rivals too, are stable, in linear analysis and in their runs."""
        return all(
            math.isfinite(sensitivity_peak(gains, x.delayed))
            and not self.experiment.with_plant(x.plant, x.latency_frames).run(gains).diverged
            for x in self.ensemble.expected
        )

    def space(self, *, raw: bool) -> GainSpace:
        """The paper's raw gains, or the logarithmic box around the first guess."""
        if raw:
            return RawSpace()
        given = {name: (low, high) for name, low, high in self.settings.gain_bounds}
        bounds = tuple(given.get(name.lower()) for name in SHORT_NAMES)
        return SearchSpace(self.first_guess, self.settings.decades, bounds)


def silent(title: str, done: int, total: int, remark: str = "") -> None:
    """Report to nobody."""


def pose_problem(
    plant: Plant, settings: TuneSettings, report: Report = silent, rivals: Sequence[Rival] = ()
) -> TuningProblem:
    """Linearise `plant` at the setpoint and set up the runs.

    A gain factor of the ensemble, or a rival, under which the setpoint is out of reach is left out, and a note says so.

    Args:
        plant: as it starts.
        settings: of the tuning.
        report: is told how far the work is.
        rivals: what the device may be instead.

    Raises:
        InputError: the setpoint is out of reach, or the plant does not answer or answers downwards.
        RunError: the plant failed.
    """
    ensemble, notes = _spread(plant, settings, partial(report, "learning the plant"))
    for rival in rivals:
        try:
            tell = partial(report, f"learning a rival, {rival.name}")
            its, told = _spread(rival.plant, settings, tell, rival.name)
        except InputError as error:
            notes = [*notes, f"the tuning does not cover {rival.name}, which the records leave open: {error}"]
            continue
        ensemble, notes = ensemble.beside(its), [*notes, *(f"{rival.name}: {x}" for x in told)]
    experiment = StepExperiment(
        plant,
        settings.limits,
        settings.setpoint_um,
        settings.sampling,
        settings.duration_s,
        seed=settings.seed,
        slew_V_per_s=settings.slew_V_per_s,
    )
    patience = _patience(ensemble.nominal.linearisation.point, settings)
    return problem_of(experiment, ensemble, settings, (*notes, *patience))


def as_known(problem: TuningProblem, gain_error_percent: float, late_frames: int) -> PractitionerObjective:
    """Return the practitioner's objective on a device, and its rivals, that is known so well.

    Raises:
        InputError: the setpoint is out of reach.
        RunError: a plant failed.
    """
    settings = replace(problem.settings, gain_error_percent=gain_error_percent, late_frames=late_frames)
    tell = partial(silent, "")
    ensemble, _ = _spread(problem.experiment.plant, settings, tell)
    for rival in problem.ensemble.rivals:
        ensemble = ensemble.beside(_spread(rival.plant, settings, tell, rival.rival)[0])
    return PractitionerObjective(problem.experiment, ensemble, problem.practitioner.priorities)


def _spread(
    plant: Plant, settings: TuneSettings, tell: Callable[[int, int, str], None], rival: str = ""
) -> tuple[Ensemble, list[str]]:
    """Return a plant with every gain factor under which the setpoint is within reach, and notes about the others."""
    frames = _longest_wait(settings)
    tell(0, 1 + len(settings.gain_factors), "where it comes to rest")
    factors, notes = _factors_within_reach(plant, settings, frames)
    ensemble = build_ensemble(
        plant, settings.setpoint_um, settings.sampling, settings.limits, factors, settings.extra_frames,
        most_frames=frames, tell=tell, rival=rival,
    )  # fmt: skip
    return ensemble, notes


def problem_of(
    experiment: StepExperiment, ensemble: Ensemble, settings: TuneSettings, notes: Sequence[str] = ()
) -> TuningProblem:
    """Return the problem of an ensemble, whatever plants are in it.

    Raises:
        InputError: the nominal plant does not answer, or answers downwards.
    """
    practitioner = PractitionerObjective(experiment, ensemble, _priorities(settings))
    reduced = reduce_model(ensemble.nominal.linearisation.model, settings.sampling.latency_frames)
    return TuningProblem(
        settings=settings,
        experiment=experiment,
        ensemble=ensemble,
        practitioner=practitioner,
        objective=_objective(settings.objective, experiment, practitioner),
        reduced=reduced,
        first_guess=_stable_start(first_guess(reduced, settings.sampling.period_s), ensemble, settings.max_ms),
        notes=tuple(notes),
    )


def _priorities(settings: TuneSettings) -> Priorities:
    """Return the bounds as asked for; nothing is paid up to six sevenths of Ms - 1 and half the overshoot."""
    return Priorities(
        sensitivity_bound=settings.max_ms,
        sensitivity_comfort=1.0 + _MS_COMFORT * (settings.max_ms - 1.0),
        overshoot_bound=settings.max_overshoot_percent / 100.0,
        overshoot_comfort=0.5 * settings.max_overshoot_percent / 100.0,
        settling_bound_s=settings.settle_within_s,
        noise_gain_bound_V_per_um=settings.max_noise_gain_V_per_um,
        **{WEIGHTS[name]: value for name, value in settings.weights},
    )


def _objective(name: str, experiment: StepExperiment, practitioner: PractitionerObjective) -> Objective:
    if name == "practitioner":
        return practitioner
    return mean_squared_error(experiment) if name == "mse" else itae(experiment)


def _longest_wait(settings: TuneSettings) -> int:
    """Frames in which a plant has to show what a run of the loop can show: what creeps on is slower than the loop."""
    wanted = math.ceil(_RUNS_WAITED * settings.duration_s * settings.rate_Hz)
    return min(max(wanted, 2 * FEWEST_FRAMES, math.ceil(DEAD_TIME_S * settings.rate_Hz)), MOST_FRAMES)


def _stable_start(guess: Gains, ensemble: Ensemble, bound: float) -> Gains:
    """Return the first guess, or the nearest slower gains under which the loop holds in every case of the ensemble.

    Proportional and derivative action yield first: on a plant that rings, or behind a dead time, they are what breaks
    the loop, and integral action alone holds any stable plant if it is slow enough.
    """
    for k in range(_MOST_HALVINGS):
        calm = replace(
            guess,
            proportional_V_per_um=guess.proportional_V_per_um * 0.25**k,
            integral_V_per_um_s=guess.integral_V_per_um_s * 0.7**k,
            derivative_V_s_per_um=guess.derivative_V_s_per_um * 0.25**k,
        )
        if max(sensitivity_peak(calm, case.delayed) for case in ensemble.cases) <= _STARTS_WITHIN * bound:
            return calm
    return guess


def _factors_within_reach(plant: Plant, settings: TuneSettings, frames: int) -> tuple[tuple[float, ...], list[str]]:
    ends = [settle(plant, voltage_V, settings.sampling, frames) for voltage_V in (settings.lower_V, settings.upper_V)]
    lowest, highest = sorted(end.displacement_um for end in ends)
    if not lowest <= settings.setpoint_um <= highest:
        find_operating_point(plant, settings.setpoint_um, settings.sampling, settings.limits, frames)
    room, rest = _CLEARANCE * (highest - lowest), restart(plant)
    reach = {
        factor: (rest + factor * (lowest - rest), rest + factor * (highest - rest)) for factor in settings.gain_factors
    }
    kept = tuple(
        factor
        for factor, (low, high) in reach.items()
        if factor == 1.0 or low + factor * room <= settings.setpoint_um <= high - factor * room
    )
    notes = [
        f"with gain x {factor:g} the plant reaches {reach[factor][0]:.4g} to {reach[factor][1]:.4g} µm, and the "
        "set-point lies outside or at an end of that: the tuning does not cover that case"
        for factor in settings.gain_factors
        if factor not in kept
    ]
    travel_um = highest - lowest
    if settings.setpoint_um and travel_um > SMALL_SETPOINT * abs(settings.setpoint_um):
        notes.append(
            f"the plant travels {travel_um:.3g} µm for a setpoint of {settings.setpoint_um:.3g} µm: has "
            "its output another unit than it declares, or is the setpoint not in µm?"
        )
    return kept, notes


def _patience(point: OperatingPoint, settings: TuneSettings) -> list[str]:
    waited_s = point.frames / settings.rate_Hz
    if point.settled and waited_s <= 2.0 * settings.duration_s:
        return []
    found = (
        f"comes to rest in about {waited_s:.3g} s" if point.settled else f"does not come to rest in {waited_s:.3g} s"
    )
    return [f"the plant {found}, a run lasts {settings.duration_s:g} s: think of a longer --duration or a lower --rate"]
