"""What a user asks of a loop, what a tuning starts from and refuses to write, which shaper it takes."""

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from following_controllers import followed_as
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_export.build import build_plant_fmu
from bender_loop.control.pid import Gains
from bender_loop.control.sampling import Sampling
from bender_loop.errors import InputError
from bender_loop.fmu.followed_model import FollowedModel
from bender_loop.fmu.plant import FmuPlant
from bender_plant.model import load_model
from bender_tuner.command import add_arguments, settings_from
from bender_tuner.model.disturbances import noise_gain_V_per_um
from bender_tuner.model.ensemble import EXTRA_FRAMES, GAIN_FACTORS
from bender_tuner.model.linear_model import settle
from bender_tuner.model.margins import sensitivity_peak
from bender_tuner.model.reduced_model import reduce_model
from bender_tuner.model.sampled_model import model_from_step
from bender_tuner.model.scaled_plant import ScaledPlant
from bender_tuner.results.summary import kind_line
from bender_tuner.results.tuning_file import FmuFacts
from bender_tuner.task.contenders import line_up
from bender_tuner.task.following import MOST_TICKS, Following, Scored, candidates, choose
from bender_tuner.task.practitioner import Priorities
from bender_tuner.task.problem import pose_problem
from bender_tuner.task.search_space import SearchSpace, edges
from bender_tuner.task.session import run_session, write_results
from bender_tuner.task.settings import make_settings
from bender_tuner.task.tuning import Ended, run_search, ziegler_nichols_rule


@pytest.fixture(scope="module")
def paper_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_plant_fmu(load_model("paper"), tmp_path_factory.mktemp("fmu") / "paper.fmu")


def _parsed(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return parser.parse_args(words)


def test_without_wishes_the_bounds_are_the_standard_ones(paper_fmu: Path):
    with FmuPlant(paper_fmu) as plant:
        assert pose_problem(plant, make_settings()).practitioner.priorities == Priorities()


@pytest.mark.parametrize(
    ("wishes", "said"),
    [
        ({"max_ms": 1.0}, "max_ms must be 1.05 to 100"),
        ({"max_overshoot_percent": -1.0}, "max_overshoot_percent must be"),
        ({"settle_within_s": 3.0}, "at most duration_s, 2 s"),
        ({"settle_within_s": math.nan}, "settle_within_s must be"),
        ({"max_noise_gain_V_per_um": 0.0}, "max_noise_gain_V_per_um must be"),
        ({"decades": 0.0}, "decades must be"),
        ({"gain_error_percent": 100.0}, "gain_error_percent must be 0 to 90"),
        ({"late_frames": -1}, "late_frames must be >= 0"),
        ({"weights": (("comfort", 1.0),)}, "weight 'comfort' is unknown: choose one of bounds, effort"),
        ({"weights": (("worst_case", 1.5),)}, "weight worst_case must be 0 to 1, found 1.5"),
        ({"weights": (("effort", math.inf),)}, "weight effort must be 0 to"),
        ({"weights": (("effort", 1.0),), "objective": "mse"}, "weights: found with the objective mse"),
        ({"max_ms": 1.5, "objective": "itae"}, "max_ms: found with the objective itae, expected practitioner"),
    ],
)
def test_wishes_that_make_no_sense(wishes: dict[str, float], said: str):
    with pytest.raises(InputError, match=said):
        make_settings(**wishes)


def test_what_may_be_off_makes_the_cases_that_gains_are_judged_with(paper_fmu: Path):
    assert make_settings().gain_factors == GAIN_FACTORS
    assert make_settings().extra_frames == EXTRA_FRAMES
    with FmuPlant(paper_fmu) as plant:
        known = pose_problem(plant, make_settings(gain_error_percent=0.0, late_frames=0)).ensemble
        near = pose_problem(plant, make_settings(gain_error_percent=5.0, late_frames=2)).ensemble
    assert [(x.gain_factor, x.latency_frames) for x in known.cases] == [(1.0, 1)]
    assert [(x.gain_factor, x.latency_frames) for x in near.cases] == [
        (factor, frames) for factor in (0.95, 1.0, 1.05) for frames in (1, 3)
    ]


@pytest.mark.slow
def test_a_bound_is_a_parabola_that_is_one_at_the_bound(paper_fmu: Path):
    gains = Gains(0.3, 12.0, 0.01)
    with FmuPlant(paper_fmu) as plant:
        problem = pose_problem(plant, make_settings())
        free = problem.practitioner.evaluate(gains)
        noise = noise_gain_V_per_um(gains, problem.ensemble.nominal.delayed)
        for bound, kept in ((1.001 * noise, True), (noise / 1.001, False)):
            with FmuPlant(paper_fmu) as again:
                asked = pose_problem(again, make_settings(max_noise_gain_V_per_um=bound)).practitioner
                found = asked.evaluate(gains)
            assert found.noise_gain_V_per_um == pytest.approx(noise)
            paid = ((noise - 0.9 * bound) / (0.1 * bound)) ** 2
            assert found.penalty - free.penalty == pytest.approx(
                asked.priorities.bound_weight * max(found.tracking, 1.0) * paid
            )
            assert found.bounds_kept is (kept and free.bounds_kept)


def test_a_weight_weighs_what_it_says(paper_fmu: Path):
    settings = settings_from(_parsed("--weight", "effort=3", "--weight", "worst_case=1"))
    assert settings.weights == (("effort", 3.0), ("worst_case", 1.0))
    with FmuPlant(paper_fmu) as plant:
        weighed = pose_problem(plant, settings).practitioner
        assert weighed.priorities == replace(Priorities(), effort_weight=3.0, worst_share=1.0)
        found = weighed.evaluate(Gains(0.3, 12.0, 0.01))
    assert found.tracking == max(case.score for case in found.cases)


@pytest.mark.slow
def test_the_tuning_follows_the_wishes_and_says_how_far(paper_fmu: Path):
    found = []
    for wishes in ({}, {"max_ms": 1.3, "max_noise_gain_V_per_um": 0.4, "settle_within_s": 1.9}):
        with FmuPlant(paper_fmu) as plant:
            problem = pose_problem(plant, make_settings(evaluations=90, **wishes))
            run = run_search(problem, "reliable_bas")
            assert run.gains is not None
            found.append((problem, problem.practitioner.evaluate(run.gains)))
    (_, usual), (problem, careful) = found
    assert careful.worst_sensitivity_peak < usual.worst_sensitivity_peak
    assert careful.worst_sensitivity_peak <= 1.3
    assert careful.noise_gain_V_per_um <= 0.4
    assert careful.bounds_kept


@pytest.mark.slow
def test_a_gain_on_the_edge_of_the_box_is_said(paper_fmu: Path):
    with FmuPlant(paper_fmu) as plant:
        problem = pose_problem(plant, make_settings(evaluations=4))
        space = SearchSpace(problem.first_guess)
        assert edges(space, problem.first_guess) == ([], [])
        assert edges(space, space.to_gains([0.0, 1.0, 0.5])) == (["Kp on the lower edge", "Ki on the upper edge"], [])
        run = replace(run_search(problem, "random"), gains=space.to_gains([0.0, 0.5, 0.5]))
        (contender, *_) = line_up(problem, [run], ziegler_nichols_rule(problem))
    assert "Kp on the lower edge of the search box, 1.5 decades" in contender.remark


@pytest.mark.slow
def test_given_bounds_hold_in_every_evaluation_and_a_gain_on_them_is_said(paper_fmu: Path):
    asked = {"evaluations": 40, "gain_bounds": (("kp", 0.3, 0.4), ("ki", 1.0, 2.0))}
    with FmuPlant(paper_fmu) as plant:
        problem = pose_problem(plant, make_settings(**asked))
        runs = [run_search(problem, method) for method in ("reliable_bas", "random")]
        (contender, *_) = line_up(problem, runs, ziegler_nichols_rule(problem))
    tried = [x.gains for run in runs for x in run.history if x.gains is not None]
    assert len(tried) >= 40
    assert all(0.3 <= x.proportional_V_per_um <= 0.4 and 1.0 <= x.integral_V_per_um_s <= 2.0 for x in tried)
    # free, the search ends at 7 V/(um s)
    assert "Ki on its upper bound, 2: a better value may lie beyond what --bounds allows" in contender.remark


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"gain_bounds": (("k", 1.0, 2.0),)}, "there is no such gain, choose one of kp, ki, kd"),
        ({"gain_bounds": (("ki", 0.0, 2.0),)}, "found 0 to 2 V/\\(µm s\\), expected a low end above 0"),
        ({"gain_bounds": (("kd", 2.0, 2.0),)}, "bounds of kd: found 2 to 2"),
        ({"gain_bounds": (("kp", 0.1, 2.0),), "method": "bas_printed"}, "found with bas_printed"),
        ({"gain_bounds": (("kp", 0.1, 2.0),), "method": "zn"}, "zn, a rule that searches nothing"),
    ],
)
def test_bounds_that_make_no_sense_are_refused(given: dict[str, Any], said: str):
    with pytest.raises(InputError, match=said):
        make_settings(**given)


@pytest.mark.parametrize("word", ["kp", "kp=1", "kp=1:x", "kp:1=2", "kp=1:inf"])
def test_words_that_are_no_bounds_are_refused(word: str, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        _parsed("--bounds", word)
    assert "--bounds" in capsys.readouterr().err


def test_bounds_are_given_together_or_one_by_one():
    both = settings_from(_parsed("--bounds", "kp=0.1:2", "Ki=1:20", "--bounds", "kd=1e-4:0.1"))
    assert both.gain_bounds == (("kp", 0.1, 2.0), ("ki", 1.0, 20.0), ("kd", 1e-4, 0.1))


@pytest.mark.parametrize(
    ("gains", "said"),
    [
        (Gains(1e-4, 7.0, 1e-4), "in practice an I controller"),
        (Gains(0.7, 7.0, 1e-4), "in practice a PI controller"),
        (Gains(0.7, 7.0, 0.07), None),
        (Gains(0.0, 7.0, 0.07), "in practice an ID controller"),
    ],
)
def test_what_a_controller_is_in_practice(gains: Gains, said: str | None):
    lines = list(kind_line(gains, 0.22))
    assert (lines == []) if said is None else lines[0].startswith(said)
    assert list(kind_line(gains, math.nan)) == []


@pytest.mark.parametrize(("rate_Hz", "duration_s"), [(1000.0, 2.0), (30.0, 2.0), (1.0, 60.0), (0.1, 600.0)])
def test_a_run_is_long_enough_for_the_frames_of_a_slow_loop(rate_Hz: float, duration_s: float):
    assert make_settings(rate_Hz=rate_Hz).duration_s == duration_s
    assert make_settings(rate_Hz=rate_Hz, duration_s=20.0).duration_s == 20.0


class Late:
    """A static gain that rings and creeps behind a dead time, each part a closed form of the time since a change."""

    def __init__(self, delay_s: float, creep: float = 0.0, ringing: float = 0.0, offset_um: float = 0.0) -> None:
        self.delay_s, self.creep, self.ringing, self.offset_um = delay_s, creep, ringing, offset_um
        self.reset()

    def set_parameters(self, parameters: object, /) -> None:
        del parameters

    def reset(self) -> None:
        self.time_s, self.changes, self.last_V = 0.0, [], 0.0

    def read(self) -> float:
        return self.offset_um + sum(change * self._answer(self.time_s - at) for at, change in self.changes)

    def step(self, voltage_V: float, step_s: float) -> float:
        if voltage_V != self.last_V:
            self.changes.append((self.time_s, voltage_V - self.last_V))
            self.last_V = voltage_V
        self.time_s += step_s
        return self.read()

    def close(self) -> None:
        """Nothing is open."""

    def _answer(self, since_s: float) -> float:
        t = since_s - self.delay_s
        if t <= 0.0:
            return 0.0
        rings = self.ringing * math.exp(-13.0 * t) * math.cos(655.0 * t)
        return 1.0 - rings + self.creep * -math.expm1(-t / 20.0)


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.floats(0.0, 0.2), st.floats(0.0, 0.5), st.sampled_from([30.0, 100.0, 300.0]))
def test_the_dead_time_is_that_of_the_first_answer_whatever_creeps_behind_it(delay_s: float, creep: float, rate: float):
    plant, period = Late(delay_s, creep), 1.0 / rate
    plant.reset()
    response = [0.0, *(plant.step(1.0, period) for _ in range(round(10.0 * rate)))]
    found = reduce_model(model_from_step(period, np.array(response)), 1)
    assert found.delay_s == pytest.approx(2.5 * period + delay_s, abs=1.1 * period)


def test_a_plant_in_its_dead_time_is_not_at_rest():
    sampling = make_settings(rate_Hz=100.0, exposure_s=0.0).sampling
    for delay_s in (0.5, 3.0):
        assert settle(Late(delay_s), 10.0, sampling).displacement_um == pytest.approx(10.0)


def test_out_of_reach_says_whether_a_plant_still_moves_or_does_not_answer_at_all():
    given = make_settings(rate_Hz=10.0, exposure_s=0.0, setpoint_um=90.0, duration_s=2.0)
    with pytest.raises(InputError, match=r"out of reach within 10 s: .* between 0 and 6\d.\d+ µm and still moves"):
        pose_problem(Late(0.0, creep=1.0), given)
    with pytest.raises(InputError, match=r"does not answer within 10 s; check the names"):
        pose_problem(Late(30.0), given)


def test_what_a_plant_reads_at_rest_is_no_part_of_its_gain():
    scaled = ScaledPlant(Late(0.0, offset_um=20.0), 1.3)
    scaled.reset()
    assert scaled.read() == 20.0
    assert scaled.step(10.0, 0.1) == pytest.approx(20.0 + 1.3 * 10.0)


def test_a_search_starts_where_every_case_of_the_ensemble_holds():
    problem = pose_problem(Late(0.045, creep=0.2, ringing=0.9), make_settings(exposure_s=0.0, evaluations=1))
    peaks = [sensitivity_peak(problem.first_guess, case.delayed) for case in problem.ensemble.cases]
    assert max(peaks) < 2.0 * problem.settings.max_ms


def test_gains_that_break_their_bounds_are_not_written(tmp_path: Path):
    wanted = make_settings(
        exposure_s=0.0, max_ms=1.05, max_overshoot_percent=0.01, settle_within_s=0.05, evaluations=3, duration_s=1.0
    )
    plant = Late(0.045)
    facts = FmuFacts("late.fmu", "late", "", "", "voltage", "displacement", ())
    session = run_session(plant, facts, pose_problem(plant, wanted))  # pyright: ignore[reportArgumentType]
    assert session.ended is Ended.REFUSED
    assert len(session.searches[0].history) > wanted.evaluations, "the box has grown before"
    write_results(session, facts, tmp_path)
    assert not (tmp_path / "gains.toml").exists()
    assert (tmp_path / "tuning.json").exists()


def scored(rate: float, horizon: int, rms_um: float, value: float = 1.0, kept: bool = True) -> Scored:
    model = followed_as("0" * 64, rate_um_per_s=rate, horizon_ticks=horizon)
    return Scored(Following(model, Path("model.fmu")), value, rms_um, kept)


def model_of(chosen: Scored | None) -> FollowedModel:
    assert chosen is not None
    return chosen.following.model


def test_the_calmest_of_those_that_are_as_near_is_taken():
    quick, calm, slow = scored(600.0, 1, 1.000), scored(200.0, 1, 1.008), scored(100.0, 1, 1.02)
    assert model_of(choose([quick, calm, slow])).rate_um_per_s == 200.0


def test_a_shaper_that_costs_a_tenth_of_the_rms_is_not_calm_but_slow():
    """Most of a step's rms is its dead time: what a shaper adds looks small beside it."""
    quick, slow = scored(300.0, 2, 1.0), scored(100.0, 1, 1.1)
    assert model_of(choose([quick, slow])).rate_um_per_s == 300.0


TRIED = (
    (200.0, 1, 2.6748, 1.6385), (150.0, 1, 2.7750, 1.6190), (120.0, 1, 2.8927, 1.5957), (100.0, 1, 2.9928, 1.6302),
    (60.0, 1, 3.3900, 1.8054), (600.0, 2, 2.5748, 1.6821), (300.0, 2, 2.5748, 1.6821), (200.0, 2, 2.5813, 1.6457),
    (150.0, 2, 2.6236, 1.6134), (120.0, 2, 2.7209, 1.5459), (100.0, 2, 2.8091, 1.5728), (60.0, 2, 3.2075, 1.7326),
)  # fmt: skip
"""Behind a dead time of 120 ms: rate, horizon, rms of the step, objective."""


@pytest.mark.parametrize("seed", range(20))
def test_what_the_noise_of_an_objective_may_decide_costs_no_rms(seed: int):
    noise = np.random.default_rng(seed).normal(0.0, 0.015, len(TRIED))
    tried = [scored(*x[:3], value=x[3] * (1.0 + y)) for x, y in zip(TRIED, noise, strict=True)]
    chosen = choose(tried, plain=1.913, spread=lambda _: 0.1)
    assert chosen is not None
    assert chosen.nominal_rms_um < 1.02 * min(x[2] for x in TRIED)


def test_a_longer_horizon_is_taken_only_where_it_helps():
    assert model_of(choose([scored(600.0, 2, 1.0), scored(600.0, 1, 1.01)])).horizon_ticks == 1


@pytest.mark.parametrize(("slow_kept", "known"), [(True, 1), (False, 2)])
def test_a_known_reference_has_the_shortest_horizon_that_keeps_the_bounds_at_all(slow_kept: bool, known: int):
    tried = [scored(600.0, 1, 0.7, kept=False), scored(100.0, 1, 1.3, kept=slow_kept), scored(300.0, 2, 1.0)]
    model = model_of(choose(tried))
    assert (model.horizon_ticks, model.preview_horizon_ticks) == (2, known)


def test_a_known_reference_takes_no_horizon_that_is_worse_than_the_block_alone():
    tried = [scored(100.0, 2, 9.0, value=5.0), scored(100.0, 8, 1.0)]
    model = model_of(choose(tried, plain=2.0))
    assert (model.horizon_ticks, model.preview_horizon_ticks) == (8, 8)


@pytest.mark.parametrize(("spread", "rate"), [(0.0, 60.0), (0.01, 60.0), (0.03, 300.0)])
def test_as_safe_as_the_best_is_what_differs_from_it_by_no_more_than_it_does_from_itself(spread: float, rate: float):
    quick, safe = scored(300.0, 1, 0.6, value=1.05), scored(60.0, 1, 1.0)
    assert model_of(choose([quick, safe], spread=lambda _: spread)).rate_um_per_s == rate


def test_what_breaks_a_bound_or_is_worse_with_a_wrong_gain_is_not_taken():
    broken, fragile, sound = (
        scored(600.0, 1, 0.5, kept=False),
        scored(300.0, 1, 0.6, value=1.05),
        scored(60.0, 1, 1.0),
    )
    assert model_of(choose([broken, fragile, sound])).rate_um_per_s == 60.0
    assert choose([broken, scored(1.0, 1, 1.0, value=math.inf)]) is None


@pytest.mark.parametrize(("lag_s", "longest"), [(0.0, 2), (0.03, 2), (0.2, 8), (50.0, MOST_TICKS)])
def test_horizons_grow_up_to_the_lag_of_the_plant(lag_s: float, longest: int):
    groups = list(candidates(followed_as("0" * 64), Path("model.fmu"), 10.0, Sampling(50.0), lag_s))
    horizons = [{x.model.horizon_ticks for x in group} for group in groups]
    assert horizons[0] == {1, 2}
    assert [max(x) for x in horizons] == [2 * 2**k for k in range(len(groups))]
    assert max(horizons[-1]) == longest


def test_what_is_no_better_than_the_block_alone_is_none():
    assert choose([scored(100.0, 1, 1.0, value=2.0)], plain=2.0) is None
