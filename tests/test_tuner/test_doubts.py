"""A model that nobody vouches for is followed only where that harms no device without one of its effects."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import pytest
from following_controllers import followed
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.control.pid import Gains
from bender_loop.control.sampling import Sampling
from bender_loop.fmu.diagnosed import Diagnosed
from bender_native.lacking import lacking_fmus, without_each_effect
from bender_native.ready import ready_plant_fmu
from bender_plant.model import Model, load_model
from bender_plant.valid_range import ValidRange
from bender_tuner.task.contenders import Contender
from bender_tuner.task.doubts import WORSE, Doubt, harm
from bender_tuner.task.experiment import FINEST_STEP_S, Moves
from bender_tuner.task.following import Following
from bender_tuner.task.practitioner import PractitionerReport, Priorities
from bender_tuner.task.problem import silent
from bender_tuner.task.recommendation import recommend
from bender_tuner.task.session import Session, open_beside, open_guarded, pose_problem_in_units, run_session
from bender_tuner.task.settings import make_settings

CAMERA = {"rate_Hz": 30.0, "latency_frames": 0, "exposure_s": 0.0, "slew_V_per_s": 225.0, "evaluations": 31}
FALSE = {"slew_limit": {"slew_rate_V_per_s": 500.0}}
CAMERA_SAMPLING = Sampling(30.0)
LATE_SOURCE = {
    "slew_limit": {"slew_rate_V_per_s": 41.1},
    "creep": {"gains": (0.0635,), "time_constants_s": (2.63,)},
}


def with_effects(effects: Mapping[str, Mapping[str, object]]) -> Model:
    model = load_model("paper")
    for name, parameters in effects.items():
        model = model.with_block(name, **parameters)
    return model


def tuned(model: Model, *, doubted: bool, **asked: float) -> Session:
    fmu = ready_plant_fmu(model)
    with (
        open_guarded(fmu, found=Diagnosed()) as (plant, facts),
        open_beside(plant, facts, lacking_fmus(model) if doubted else ()) as lacking,
    ):
        problem = pose_problem_in_units(plant, make_settings(**CAMERA | asked), facts)
        return run_session(plant, facts, problem, follow_model=True, doubted=lacking)


@pytest.mark.slow
def test_a_false_name_is_refused_where_nobody_vouches_for_it():
    """Behind a slew limit that it has not, a device rings for what the model is led to in one move."""
    assert tuned(with_effects(FALSE), doubted=False).following is not None
    refused = tuned(with_effects(FALSE), doubted=True)
    assert refused.following is None
    assert "on a device without slew_limit, for which no diagnosis vouches" in refused.following_note
    assert "of the PID block alone; say with --gain-error" in refused.following_note
    vouched = tuned(with_effects(FALSE), doubted=True, gain_error_percent=5.0)
    assert vouched.following is not None, "the user's word stands"


@dataclass(frozen=True)
class Judge:
    """An objective whose value with a model is a multiple of that of the PID block alone; a known sine is as told."""

    alone: PractitionerReport
    times: float
    ratio: float
    priorities: Priorities

    def evaluate(self, gains: Gains, following: Following | None = None) -> PractitionerReport:
        del gains
        return replace(self.alone, value=self.times * self.alone.value) if following else self.alone

    def spread(self, gains: Gains, following: Following | None = None) -> float:
        del gains, following
        return 0.0

    def keeps_overshoot(self, *_: object) -> bool:
        return True

    def known_sine_ratio(self, *_: object) -> float:
        return self.ratio


@pytest.mark.parametrize(
    ("times", "ratio", "follows"), [(0.9, 2.0, True), (1.03, 0.2, True), (1.03, 0.8, False), (1.07, 0.1, False)]
)
def test_where_steps_gain_nothing_a_model_is_followed_for_what_is_known_beforehand(
    times: float, ratio: float, follows: bool
):
    fmu = ready_plant_fmu("beam")
    contenders = [Contender("reliable_bas", "reliable_bas", "search", Gains(0.0, 5.0))]
    with open_guarded(fmu) as (plant, facts):
        problem = pose_problem_in_units(plant, make_settings(**CAMERA), facts)
        usual = problem.practitioner
        alone = replace(usual.evaluate(contenders[0].gains or Gains(0.0, 0.0)), bounds_kept=True)
        judge = Judge(alone, times, ratio, usual.priorities)
        judged = replace(problem, practitioner=judge)  # pyright: ignore[reportArgumentType]
        found = recommend(judged, contenders, followed(fmu), fmu, None, silent)
    assert found is not None
    assert (found.following is not None) == follows
    known = "a reference that is known beforehand is followed with 0.2 of its error" in found.sentence
    assert known == (follows and times > 1.0)


def test_a_known_sine_is_followed_nearer_with_the_right_model():
    fmu = ready_plant_fmu("beam")
    with open_guarded(fmu) as (plant, facts):
        problem = pose_problem_in_units(plant, make_settings(**CAMERA | {"gain_error_percent": 5.0}), facts)
        gains, followed_fmu = Gains(0.0, 5.0), Following(followed(fmu), fmu)
        assert problem.practitioner.known_sine_ratio(0.2, gains, followed_fmu) < 0.5


@dataclass(frozen=True)
class Answers:
    """An experiment of which the answers are known: moves at the frames and between them, and a sine."""

    moves: Moves
    swing_percent: float
    sine_um: float
    sampling: Sampling = CAMERA_SAMPLING

    def up_and_down(self, *_: object) -> Moves:
        if self.sampling.substeps == 1:
            return self.moves
        assert self.sampling.plant_step_s <= FINEST_STEP_S
        return self.moves._replace(overshoot_percent=self.swing_percent)

    def known_sine_um(self, *_: object) -> float:
        return self.sine_um


figures = st.floats(0.01, 50.0)
answers = st.builds(Answers, st.builds(Moves, figures, figures, figures), figures, figures)


@given(answers, answers, answers, st.floats(0.1, 5.0))
def test_harm_is_what_is_worse_than_the_block_alone_and_than_what_is_allowed(
    alone: Answers, found: Answers, nominal: Answers, most: float
):
    doubt = Doubt("creep", found, nominal, 0.3, alone.moves, alone.sine_um)  # pyright: ignore[reportArgumentType]
    told = harm((doubt,), Gains(0.0, 0.0), None, most)  # pyright: ignore[reportArgumentType]
    pairs = [
        *zip(found.moves, alone.moves, (most, 0.0, 0.0), strict=True),
        (found.sine_um, alone.sine_um, 0.0),
        (found.swing_percent, nominal.swing_percent, most),
    ]
    assert bool(told) == any(value > max(allowed, WORSE * least) for value, least, allowed in pairs)
    assert not told or "without creep" in told


def test_every_effect_is_left_out_once_and_what_a_linear_model_has_never():
    model = with_effects({**LATE_SOURCE, "thermal_drift": {"amplitude_um": 1.0}, "transport_delay": {"delay_s": 0.02}})
    found = without_each_effect(model)
    assert [name for name, _ in found] == ["transport_delay", "slew_limit", "creep"]
    for name, lacking in found:
        assert [x.id for x in lacking.blocks] == [x.id for x in model.blocks if x.id != name]
    assert without_each_effect(load_model("paper")) == without_each_effect(load_model("beam")) == ()


def test_the_effects_of_an_fmu_are_those_of_the_model_in_it():
    model = load_model("beam").with_block("transport_delay", delay_s=0.06)
    fmu = ready_plant_fmu(model)
    assert lacking_fmus(fmu) == lacking_fmus(model) == (("transport_delay", ready_plant_fmu("beam")),)


@pytest.mark.parametrize(("highest_V", "said"), [(5.0, True), (50.0, False)])
def test_a_set_point_beyond_what_the_model_was_learned_from_is_noted(highest_V: float, said: bool):
    model = replace(load_model("beam"), valid=ValidRange(0.0, highest_V, 60.0))
    with open_guarded(ready_plant_fmu(model)) as (plant, facts):
        notes = pose_problem_in_units(plant, make_settings(**CAMERA), facts).notes
    assert any(f"the model was learned from 0 to {highest_V:g} V: beyond" in x for x in notes) == said
