"""What a user asks of a loop: bounds of his own, and a word where they or the search box are reached."""

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bender_export.build import build_plant_fmu
from bender_loop.control.pid import Gains
from bender_loop.errors import InputError
from bender_loop.fmu.plant import FmuPlant
from bender_plant.model import load_model
from bender_tuner.command import add_arguments, settings_from
from bender_tuner.model.disturbances import noise_gain_V_per_um
from bender_tuner.model.ensemble import EXTRA_FRAMES, GAIN_FACTORS
from bender_tuner.results.summary import kind_line
from bender_tuner.task.contenders import line_up
from bender_tuner.task.practitioner import Priorities
from bender_tuner.task.problem import pose_problem
from bender_tuner.task.search_space import SearchSpace, edges
from bender_tuner.task.settings import make_settings
from bender_tuner.task.tuning import run_search, ziegler_nichols_rule


@pytest.fixture(scope="module")
def paper_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_plant_fmu(load_model("paper"), tmp_path_factory.mktemp("fmu") / "paper.fmu")


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
    settings = settings_from(_words("--weight", "effort=3", "--weight", "worst_case=1"))
    assert settings.weights == (("effort", 3.0), ("worst_case", 1.0))
    with FmuPlant(paper_fmu) as plant:
        weighed = pose_problem(plant, settings).practitioner
        assert weighed.priorities == replace(Priorities(), effort_weight=3.0, worst_share=1.0)
        found = weighed.evaluate(Gains(0.3, 12.0, 0.01))
    assert found.tracking == max(case.score for case in found.cases)


def _words(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return parser.parse_args(words)


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


def _parsed(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return parser.parse_args([*words])


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
