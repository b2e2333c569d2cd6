"""A plant and settings made into a tuning problem: what is run, what is minimised, where the search begins."""

from collections.abc import Sequence
from dataclasses import dataclass

from bender_loop.control.pid import Gains
from bender_loop.control.plant import Plant
from bender_tuner.model.ensemble import GAIN_FACTORS, Ensemble, build_ensemble
from bender_tuner.model.linear_model import OperatingPoint, find_operating_point, settle
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
OBJECTIVE_UNITS = {"practitioner": "1", "mse": "um^2", "itae": "um s^2"}


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

    def space(self, *, raw: bool) -> GainSpace:
        """The paper's raw gains, or the logarithmic box around the first guess."""
        if raw:
            return RawSpace()
        given = {name: (low, high) for name, low, high in self.settings.gain_bounds}
        bounds = tuple(given.get(name.lower()) for name in SHORT_NAMES)
        return SearchSpace(self.first_guess, self.settings.decades, bounds)


def pose_problem(plant: Plant, settings: TuneSettings) -> TuningProblem:
    """Linearise `plant` at the setpoint and set up the runs.

    A gain factor of the ensemble under which the setpoint is out of reach is left out, and a note says so.

    Raises:
        InputError: the setpoint is out of reach, or the plant does not answer or answers downwards.
        RunError: the plant failed.
    """
    sampling, limits, setpoint_um = settings.sampling, settings.limits, settings.setpoint_um
    factors, notes = _factors_within_reach(plant, settings)
    ensemble = build_ensemble(plant, setpoint_um, sampling, limits, gain_factors=factors)
    experiment = StepExperiment(
        plant,
        limits,
        setpoint_um,
        sampling,
        settings.duration_s,
        seed=settings.seed,
        slew_V_per_s=settings.slew_V_per_s,
    )
    patience = _patience(ensemble.nominal.linearisation.point, settings)
    return problem_of(experiment, ensemble, settings, (*notes, *patience))


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
        first_guess=first_guess(reduced, settings.sampling.period_s),
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


def _factors_within_reach(plant: Plant, settings: TuneSettings) -> tuple[tuple[float, ...], list[str]]:
    ends = [settle(plant, voltage_V, settings.sampling) for voltage_V in (settings.lower_V, settings.upper_V)]
    lowest, highest = sorted(end.displacement_um for end in ends)
    if not lowest <= settings.setpoint_um <= highest:
        find_operating_point(plant, settings.setpoint_um, settings.sampling, settings.limits)
    room = _CLEARANCE * (highest - lowest)
    kept = tuple(
        factor
        for factor in GAIN_FACTORS
        if factor == 1.0 or lowest + room <= settings.setpoint_um / factor <= highest - room
    )
    notes = [
        f"with gain x {factor:g} the plant reaches {factor * lowest:.4g} to {factor * highest:.4g} µm, and the "
        "set-point lies outside or at an end of that: the tuning does not cover that case"
        for factor in GAIN_FACTORS
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
