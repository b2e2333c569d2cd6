"""A tuning on a model whose diagnosis left rivals: what it promises, it promises with each of them."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from following_controllers import followed

from bender_loop.control.closed_loop import simulate
from bender_loop.control.metrics import step_metrics
from bender_loop.control.pid import Gains
from bender_loop.control.plant import Plant
from bender_loop.control.references import Profile
from bender_loop.errors import InputError
from bender_loop.fmu.diagnosed import RivalModel, diagnosed
from bender_native.ready import ready_plant_fmu
from bender_plant.model import Model, load_model
from bender_tuner.model.ensemble import EXTRA_FRAMES, GAIN_FACTORS, Rival
from bender_tuner.model.margins import sensitivity_peak
from bender_tuner.task.experiment import StepExperiment
from bender_tuner.task.following import Following
from bender_tuner.task.problem import TuningProblem, pose_problem
from bender_tuner.task.session import open_guarded, open_rivals, pose_problem_in_units
from bender_tuner.task.settings import make_settings
from bender_tuner.task.tuning import run_search

SETTINGS = make_settings(rate_Hz=30.0, latency_frames=1, exposure_s=0.0, evaluations=45)


class Delayed:
    """A plant whose command acts so many steps of the loop later."""

    def __init__(self, plant: Plant, steps: int) -> None:
        self._plant, self._steps = plant, steps
        self.reset()

    def reset(self) -> None:
        self._plant.reset()
        self._waiting = [0.0] * self._steps

    def step(self, voltage_V: float, step_s: float) -> float:
        self._waiting.append(voltage_V)
        return self._plant.step(self._waiting.pop(0), step_s)

    def close(self) -> None:
        pass


@pytest.fixture(scope="module")
def make(linear_plant: Callable[..., Plant]) -> Callable[[], Plant]:
    return lambda: linear_plant([0.8], [0.02, 1.0])


@pytest.fixture(scope="module")
def late(make: Callable[[], Plant]) -> Rival:
    return Rival("a dead time", Delayed(make(), 4))


@pytest.fixture(scope="module")
def problem(make: Callable[[], Plant], late: Rival) -> TuningProblem:
    return pose_problem(make(), SETTINGS, rivals=[late])


def test_the_ensemble_has_the_nominal_case_of_a_rival_and_its_hardest(problem: TuningProblem):
    cases = problem.ensemble.cases
    latency = SETTINGS.latency_frames
    own = [(x.gain_factor, x.latency_frames) for x in cases if not x.rival]
    theirs = [(x.gain_factor, x.latency_frames) for x in cases if x.rival == "a dead time"]
    assert len(own) == len(GAIN_FACTORS) * len(EXTRA_FRAMES)
    assert theirs == [(1.0, latency), (max(GAIN_FACTORS), latency + max(EXTRA_FRAMES))]
    assert [x.rival for x in problem.ensemble.expected] == ["", "a dead time"]


def test_gains_keep_their_bounds_with_a_rival_and_without_it_they_do_not(
    make: Callable[[], Plant], late: Rival, problem: TuningProblem
):
    def overshoot_percent(gains: Gains) -> float:
        experiment = problem.experiment.with_plant(late.plant, SETTINGS.latency_frames)
        return experiment.metrics(experiment.run(gains)).overshoot_percent

    alone = run_search(pose_problem(make(), SETTINGS), "reliable_bas").gains
    both = run_search(problem, "reliable_bas").gains
    assert alone is not None
    assert both is not None
    bound = problem.practitioner.priorities.sensitivity_bound
    peaks = [max(sensitivity_peak(x, y.delayed) for y in problem.ensemble.cases) for x in (alone, both)]
    assert overshoot_percent(alone) > 2.0
    assert overshoot_percent(both) <= 2.0
    assert peaks[1] <= bound < peaks[0]
    assert not problem.keeps_bounds(alone)
    assert problem.keeps_bounds(both)


def test_gains_hold_only_where_every_rival_does(make: Callable[[], Plant], problem: TuningProblem):
    wild = Gains(0.0, 30.0)
    assert pose_problem(make(), SETTINGS).holds(wild)
    assert not problem.holds(wild)


def test_a_score_is_measured_by_the_delay_of_its_own_model(problem: TuningProblem):
    """A slow rival would rule the objective by being slow, whatever the gains."""
    report = problem.practitioner.evaluate(Gains(0.0, 3.0))
    nominal, rival = (x for x in report.cases if (x.gain_factor, x.latency_frames) == (1.0, SETTINGS.latency_frames))
    assert rival.score < 0.5 * nominal.score * rival.metrics.itae_um_s2 / nominal.metrics.itae_um_s2


def test_a_rival_out_of_reach_is_left_out_and_said(make: Callable[[], Plant], linear_plant: Callable[..., Plant]):
    weak = Rival("a weak one", linear_plant([0.1], [0.02, 1.0]))
    found = pose_problem(make(), SETTINGS, rivals=[weak])
    assert found.ensemble.rivals == ()
    assert any("a weak one" in x and "set-point" in x.replace("setpoint", "set-point") for x in found.notes)


def test_the_way_down_and_up_again_counts_in_parts_of_the_way_up(experiment: StepExperiment):
    gains, length_s = Gains(0.0, 14.0), experiment.duration_s
    course = Profile((0.0, length_s, 2.0 * length_s), (10.0, 5.0, 10.0))
    trace = simulate(experiment.plant, gains, experiment.limits, course, experiment.sampling, 3.0 * length_s)
    first = step_metrics(experiment.run(gains)).overshoot_percent
    third = trace.displacement_um[trace.time_s >= 2.0 * length_s]
    assert first > 1.0
    # a linear plant overshoots by the same part of every step
    assert experiment.up_and_down(gains).overshoot_percent == pytest.approx(first, rel=1e-3)
    assert 100.0 * (third.max() - 10.0) / 5.0 == pytest.approx(first, rel=1e-3)


@pytest.fixture(scope="module")
def remembering() -> Model:
    """A play that hardly shows on the way up from rest."""
    return load_model("bench").with_block("backlash", half_width_um=0.4)


def test_a_shaper_that_overshoots_on_a_later_step_does_not_keep_the_bounds(remembering: Model):
    nominal, other = ready_plant_fmu("bench"), ready_plant_fmu(remembering)
    settings = make_settings(rate_Hz=30.0, latency_frames=0, exposure_s=0.0)
    model = followed(nominal, rate_um_per_s=600.0, curvature_um_per_s2=36000.0)
    with open_guarded(other) as (plant, facts):
        found = pose_problem_in_units(plant, settings, facts)
        following, gains = Following(model, nominal), Gains(0.0, 6.0)
        first = found.practitioner.evaluate(gains, following).nominal.metrics.overshoot_percent
        all_of_them = found.experiment.up_and_down(gains, following).overshoot_percent
        assert all_of_them > first
        bound = found.practitioner.priorities.overshoot_bound
        assert found.practitioner.keeps_overshoot(gains, following) == (all_of_them <= 100.0 * bound)


def _told(folder: Path, rivals: list[dict[str, object]]) -> Path:
    told = {
        "model": "model.toml", "fmu": "model.fmu", "unit": "um", "input_unit": "V", "gap": {"after": {"rms": 0.1}},
        "rival_models": rivals,
    }  # fmt: skip
    (folder / "diagnosis.json").write_text(json.dumps(told))
    return folder / "model.fmu"


def test_rivals_of_a_diagnosis_are_opened_under_the_names_of_their_effects(tmp_path: Path):
    delayed = ready_plant_fmu(load_model("bench").with_block("transport_delay", delay_s=0.1))
    (tmp_path / "rival-1.fmu").write_bytes(delayed.read_bytes())
    one = {"effects": ["creep", "transport_delay"], "model": "rival-1.toml", "fmu": "rival-1.fmu"}
    found = diagnosed(_told(tmp_path, [one]))
    assert found.rivals == (
        RivalModel(("creep", "transport_delay"), tmp_path / "rival-1.toml", tmp_path / "rival-1.fmu"),
    )
    with (
        open_guarded(ready_plant_fmu("bench")) as (plant, facts),
        open_rivals(plant, facts, found.rivals) as (rival,),
    ):
        problem = pose_problem_in_units(plant, SETTINGS, facts, rivals=[rival])
    assert rival.name == "creep + transport_delay"
    nominal_um, rival_um = (x.linearisation.model.step_response(4)[-1] for x in problem.ensemble.expected)
    assert rival_um < 0.1 * nominal_um


def test_a_rival_that_is_all_but_excluded_is_named_and_not_designed_for(tmp_path: Path):
    rivals: list[dict[str, object]] = [
        {"effects": [x], "probability": p, "model": f"rival-{k}.toml", "fmu": f"rival-{k}.fmu"}
        for k, (x, p) in enumerate([("creep", 0.2), ("backlash", 4e-4)], start=1)
    ]
    found = diagnosed(_told(tmp_path, rivals))
    assert ([x.name for x in found.rivals], found.unlikely) == (["creep"], ("backlash",))
    with open_guarded(ready_plant_fmu("bench"), found=found) as (plant, facts):
        notes = pose_problem_in_units(plant, SETTINGS, facts).notes
    assert any("backlash" in x and "0.01" in x for x in notes)


def test_a_rival_whose_fmu_is_gone_is_refused_by_its_path(tmp_path: Path):
    gone = {"effects": [], "model": "rival-1.toml", "fmu": "rival-1.fmu"}
    found = diagnosed(_told(tmp_path, [gone]))
    assert found.rivals[0].name == "no effect"
    with (
        open_guarded(ready_plant_fmu("bench")) as (plant, facts),
        pytest.raises(InputError, match="rival-1"),
        open_rivals(plant, facts, found.rivals),
    ):
        pass
