"""Settings, problem, search loop, judgement, and what is drawn and said of them, on plants in closed form."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from few import few

from bender_loop.control.pid import Gains
from bender_loop.control.plant import Plant
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.followed_model import FollowedModel
from bender_tuner.pictures.convergence import best_rows, draw_convergence
from bender_tuner.pictures.loop import loop_figure
from bender_tuner.pictures.robustness import draw_monte_carlo, settled_share, settling_times_s
from bender_tuner.pictures.steps import draw_steps, steps_figure
from bender_tuner.results.summary import finding_lines, table_rows
from bender_tuner.task.contenders import Contender, judged, line_up
from bender_tuner.task.following import Following
from bender_tuner.task.judgement import judge, monte_carlo, variation_of
from bender_tuner.task.problem import TuningProblem, pose_problem
from bender_tuner.task.settings import TuneSettings, make_settings
from bender_tuner.task.tuning import Ended, Evaluation, SearchResult, run_search, simc_gains, ziegler_nichols_rule

PNG = b"\x89PNG"
NYQUIST_AND_BESIDE = "imaginary part", "|L|", "phase of L"
QUICK = make_settings(objective="itae", evaluations=25)
Make = Callable[..., Plant]


class Breaking:
    """A plant that raises `error` once it has been reset `lifetime` times."""

    def __init__(self, plant: Plant, lifetime: int, error: BaseException) -> None:
        self.plant, self.left, self.error = plant, lifetime, error

    def set_parameters(self, parameters: Mapping[str, float]) -> None:
        pass

    def reset(self) -> None:
        if self.left == 0:
            raise self.error
        self.left -= 1
        self.plant.reset()

    def step(self, voltage_V: float, step_s: float) -> float:
        return self.plant.step(voltage_V, step_s)

    def close(self) -> None:
        self.plant.close()


@pytest.fixture
def lag(linear_plant: Make) -> Plant:
    return linear_plant([0.8], [0.02, 1.0])


@pytest.fixture
def problem(lag: Plant) -> TuningProblem:
    return pose_problem(lag, QUICK)


def breaking(problem: TuningProblem, lifetime: int, error: BaseException) -> TuningProblem:
    plant = Breaking(problem.experiment.plant, lifetime, error)
    experiment = replace(problem.experiment, plant=plant)
    return replace(problem, experiment=experiment, objective=replace(problem.objective, experiment=experiment))  # type: ignore


def test_defaults_suit_objective_and_method() -> None:
    camera = make_settings()
    assert (camera.objective, camera.rate_Hz, camera.latency_frames) == ("practitioner", 30.0, 1)
    assert (camera.exposure_s, camera.sampling.substeps) == (0.015, 5)
    paper = make_settings(method="bas_printed")
    assert (paper.objective, paper.rate_Hz, paper.latency_frames, paper.exposure_s) == ("mse", 100.0, 0, 0.0)
    assert (paper.evaluations, paper.sampling.substeps) == (151, 1)
    assert make_settings(rate_Hz=200.0).exposure_s == pytest.approx(0.45 / 200.0)
    assert make_settings(rate_Hz=10.0).exposure_s == 0.015
    assert make_settings(objective="mse", rate_Hz=50.0).latency_frames == 0


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"method": "nix"}, "method 'nix' is unknown: choose one of bas_printed"),
        ({"compare": ("pso", "nix")}, "'nix'"),
        ({"objective": "nix"}, "practitioner, mse, itae"),
        ({"setpoint_um": math.nan}, "setpoint"),
        ({"setpoint_um": 0.0}, "setpoint"),
        ({"rate_Hz": 0.0}, "rate_Hz"),
        ({"exposure_s": 0.05}, "exposure_s"),
        ({"duration_s": 0.001}, "duration_s"),
        ({"lower_V": 5.0, "upper_V": 5.0}, "lower_V"),
        ({"upper_V": math.inf}, "finite"),
        ({"slew_V_per_s": 0.0}, "slew"),
        ({"noise_um": -1.0}, "noise_um"),
        ({"evaluations": 0}, "evaluations"),
        ({"seed": -1}, "seed"),
        ({"setpoint_um": "12"}, "setpoint_um: found '12', expected a number"),
        ({"evalutions": 3}, "evalutions: no such setting, expected one of method"),
    ],
)
def test_settings_that_make_no_sense_are_refused(given: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        make_settings(**given)


def test_a_slow_loop_reads_instants_unless_an_exposure_is_asked_for() -> None:
    assert make_settings(rate_Hz=0.2, duration_s=99.0).sampling.substeps == 1
    assert make_settings(rate_Hz=0.2, duration_s=99.0, exposure_s=1.0).exposure_s == 1.0


class Warm:
    """A plant whose reading rests far from zero."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant

    def reset(self) -> None:
        self.plant.reset()

    def read(self) -> float:
        return 293.0

    def step(self, voltage_V: float, step_s: float) -> float:
        return 293.0 + self.plant.step(voltage_V, step_s)

    def close(self) -> None:
        self.plant.close()


def test_a_set_point_that_is_meant_from_rest_is_told_as_what_is_read(lag: Plant) -> None:
    with pytest.raises(InputError, match=r"for 20 µm more than at rest, 313 µm$"):
        pose_problem(Warm(lag), replace(QUICK, setpoint_um=20.0))


def test_posing_a_problem_tells_how_far_it_is(lag: Plant) -> None:
    told: list[tuple[int, int]] = []
    pose_problem(lag, QUICK, lambda title, done, total, remark: told.append((done, total)))
    assert told == [(0, 4), (1, 4), (2, 4), (3, 4)]


def test_searches_run_once_each_and_the_asked_one_first() -> None:
    settings = make_settings(method="pso", compare=("zn", "ga", "pso", "ga", "simc"))
    assert settings.searches == ("pso", "ga")
    assert make_settings(method="zn").searches == ()


def test_a_gain_under_which_the_setpoint_is_out_of_reach_is_left_out_and_said(lag: Plant) -> None:
    problem = pose_problem(lag, replace(QUICK, setpoint_um=30.0))
    assert {case.gain_factor for case in problem.ensemble.cases} == {1.0, 1.3}
    assert len(problem.notes) == 1
    assert "gain x 0.7 the plant reaches 0 to 28 µm" in problem.notes[0]
    with pytest.raises(InputError, match="between 0 and 40 µm"):
        pose_problem(lag, replace(QUICK, setpoint_um=41.0))


@pytest.mark.slow
def test_a_plant_slower_than_the_run_is_noted(linear_plant: Make) -> None:
    problem = pose_problem(linear_plant([0.8], [3.0, 1.0]), QUICK)
    assert any("--duration" in note for note in problem.notes)


def test_a_search_keeps_its_whole_history_and_repeats_with_its_seed(problem: TuningProblem) -> None:
    seen: list[tuple[int, int, float]] = []
    run = run_search(problem, "bas", seed=4, on_evaluation=lambda *row: seen.append(row))
    assert run.ended is Ended.COMPLETE
    assert len(run.history) == 25
    assert [row[0] for row in seen] == list(range(1, 26))
    assert [e.best for e in run.history] == [min(e.value for e in run.history[: n + 1]) for n in range(25)]
    assert run.history[0].gains == problem.first_guess
    assert run.gains is not None
    assert problem.objective(run.gains) == run.value == run.history[-1].best
    assert run_search(problem, "bas", seed=4).gains == run.gains
    assert run_search(problem, "bas", seed=5).gains != run.gains


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "ended", "reason"),
    [(KeyboardInterrupt(), Ended.INTERRUPTED, ""), (RunError("the plant broke"), Ended.FAILED, "the plant broke")],
)
def test_a_search_that_is_cut_short_keeps_the_best_so_far(
    problem: TuningProblem, error: BaseException, ended: Ended, reason: str
) -> None:
    whole = run_search(problem, "bas")
    run = run_search(breaking(problem, 9, error), "bas")
    assert (run.ended, run.reason, len(run.history)) == (ended, reason, 9)
    assert run.value == whole.history[8].best < whole.history[0].best
    assert run_search(breaking(problem, 0, error), "bas").gains is None


def test_a_method_in_a_thread_of_its_own_can_be_cut_short_too(problem: TuningProblem) -> None:
    run = run_search(breaking(problem, 9, KeyboardInterrupt()), "nelder_mead")
    assert (run.ended, len(run.history)) == (Ended.INTERRUPTED, 9)


def test_raw_gains_are_searched_from_the_unit_cube(problem: TuningProblem) -> None:
    run = run_search(problem, "bas_printed", seed=2)
    first = run.history[0].gains
    assert first is not None
    assert first.derivative_on_error
    values = first.proportional_V_per_um, first.integral_V_per_um_s, first.derivative_V_s_per_um
    assert all(0.0 <= value <= 1.0 for value in values)
    assert all((e.gains is None) == math.isinf(e.value) for e in run.history)


def test_judgement_sees_what_happens_between_the_frames(linear_plant: Make) -> None:
    ringing = linear_plant([0.8], [1.0 / 650.0**2, 2.0 * 0.02 / 650.0, 1.0])
    problem = pose_problem(ringing, make_settings(objective="mse"))
    judgement = judge(problem, Gains(0.1, 40.0))
    assert judgement.trace.fine_time_s is not None
    assert np.diff(judgement.trace.fine_time_s).max() <= 1e-3 + 1e-12
    assert judgement.metrics.overshoot_percent > judgement.at_frames.overshoot_percent + 5.0
    assert judgement.value == problem.objective(Gains(0.1, 40.0))
    contender = judged(problem, line_up(problem, [found(problem, Gains(0.1, 40.0))], ziegler_nichols_rule(problem))[0])
    lines = list(finding_lines([contender], problem.practitioner.priorities, ziegler_nichols_rule(problem), ()))
    assert any(line.startswith("between the frames") for line in lines)


def found(problem: TuningProblem, gains: Gains | None, ended: Ended = Ended.COMPLETE) -> SearchResult:
    value = math.inf if gains is None else problem.objective(gains)
    return SearchResult("reliable_bas", gains, value, (Evaluation(gains, value, value),), 1, ended)


def test_contenders_stand_in_order_and_the_rules_speak(problem: TuningProblem) -> None:
    rule = ziegler_nichols_rule(problem)
    asked = replace(problem, settings=replace(QUICK, method="simc", compare=("reliable_bas",)))
    contenders = line_up(asked, [found(problem, simc_gains(problem))], rule)
    assert [c.method for c in contenders] == ["simc", "reliable_bas", "zn", "start"]
    judgements = [judged(problem, contender) for contender in contenders]
    columns, rows = table_rows(judgements)
    assert all(len(row) == len(columns) for row in rows)
    assert rows[0][1] == pytest.approx(problem.objective(simc_gains(problem)))
    lines = list(finding_lines(judgements, problem.practitioner.priorities, rule, ("a note",)))
    assert lines[0].startswith("bounds kept: worst Ms 1.")
    assert any(rule.sentence in line for line in lines)
    assert lines[-1] == "note: a note"


def test_a_contender_without_gains_is_shown_without_figures(problem: TuningProblem) -> None:
    contender = judged(problem, line_up(problem, [found(problem, None)], ziegler_nichols_rule(problem))[0])
    assert contender.judgement is None
    assert table_rows([contender])[1][0][1:] == [None] * 6
    assert "no gains" in contender.remark


def test_a_plant_that_fails_under_judgement_leaves_a_remark(problem: TuningProblem) -> None:
    broken = breaking(problem, 0, RunError("worn out"))
    contender = judged(broken, line_up(problem, [], ziegler_nichols_rule(problem))[0])
    assert contender.judgement is None
    assert "worn out" in contender.remark


def test_monte_carlo_draws_the_same_plants_for_everyone(problem: TuningProblem, lag: Plant) -> None:
    plant = Breaking(lag, -1, RunError())
    variation = variation_of(problem, {"other"})
    assert (variation.latencies_frames, variation.noise_um, dict(variation.parameters)) == ((1, 2), 0.1, {})
    results = [monte_carlo(problem, plant, gains, variation, 4) for gains in (Gains(0.0, 6.0), Gains(0.9, 40.0))]
    assert [o.draw for o in results[0].outcomes] == [o.draw for o in results[1].outcomes]
    assert results[0].unstable == 0
    assert results[1].unstable > 0
    times = settling_times_s(results[1])
    assert np.isinf(times).sum() >= results[1].unstable
    contender = replace(line_up(problem, [], ziegler_nichols_rule(problem))[0], monte_carlo=results[1])
    assert draw_monte_carlo([contender], 4.0).startswith(PNG)


def test_share_of_settled_runs_counts_up() -> None:
    share = settled_share(np.array([0.5, math.inf, 0.2, 0.5]), np.array([0.1, 0.2, 0.4, 0.5, 9.0]))
    assert share.tolist() == [0.0, 0.25, 0.25, 0.75, 0.75]


def test_best_rows_follow_what_a_method_may_keep() -> None:
    values = [(math.inf, math.inf), (5.0, 5.0), (1.0, 5.0), (4.0, 4.0), (4.0, 4.0)]
    history = tuple(Evaluation(None, value, best) for value, best in values)
    run = SearchResult("bas_printed", None, 4.0, history, 5, Ended.COMPLETE)
    assert best_rows(run).tolist() == [-1, 1, 1, 3, 3]


@pytest.mark.slow
@pytest.mark.parametrize("method", few(["reliable_bas", "bas_printed"], 0))
def test_pictures_are_drawn_of_good_and_of_hopeless_searches(problem: TuningProblem, method: str) -> None:
    runs = [run_search(problem, method), run_search(problem, "random")]
    assert draw_convergence(runs, "itae").startswith(PNG)
    hopeless = SearchResult(method, None, math.inf, (Evaluation(None, math.inf, math.inf),), 1, Ended.FAILED)
    assert draw_convergence([hopeless], "itae").startswith(PNG)
    contenders = [judged(problem, c) for c in line_up(problem, [runs[0]], ziegler_nichols_rule(problem))]
    picture = draw_steps(contenders, problem.settings, {"here": 1.0, "outside": 99.0})
    assert picture == draw_steps(contenders, problem.settings, {"here": 1.0, "outside": 99.0})
    assert picture.startswith(PNG)


def test_a_step_is_drawn_from_where_the_plant_rests(lag: Plant) -> None:
    warm = pose_problem(Warm(lag), replace(QUICK, setpoint_um=313.0))
    contender = judged(warm, Contender("simc", "SIMC", "rule", Gains(0.1, 5.0, 0.0)))
    above, _ = steps_figure([contender], warm.settings).axes
    low_um, high_um = above.get_ylim()
    assert 288.0 < low_um < 293.0
    assert 313.0 < high_um < 330.0


def test_the_headline_of_the_steps_is_that_of_the_model_that_is_followed(problem: TuningProblem) -> None:
    alone, followed = (judged(problem, Contender(x, x, "rule", Gains(0.1, ki, 0.0))) for x, ki in (("a", 2), ("b", 4)))
    model = FollowedModel("model.fmu", "", "voltage", "displacement", 1.0, 1.0, 1, 0.0, 0.0, 0.1)
    followed = replace(followed, kind="following", following=Following(model, Path("model.fmu")))
    figure = steps_figure([alone, followed], problem.settings)
    assert figure.get_suptitle().startswith("b: a step to")
    widest = max(figure.axes[0].lines, key=lambda x: x.get_linewidth())
    assert np.asarray(widest.get_ydata()).tolist() == displacement_of(followed)
    assert steps_figure([alone], problem.settings).get_suptitle().startswith("a: a step to")


def displacement_of(contender: Contender) -> list[float]:
    assert contender.judgement is not None
    fine_um = contender.judgement.trace.fine_displacement_um
    assert fine_um is not None
    return fine_um.tolist()


def test_a_plant_that_is_a_gain_alone_is_drawn(linear_plant: Make) -> None:
    figure = loop_figure(pose_problem(linear_plant([1e6], [1.0]), QUICK), Gains(1e-7, 2e-6, 0.0))
    figure.draw_without_rendering()
    low, high = next(x for x in figure.axes if x.get_ylabel().startswith("|G|")).get_ylim()
    assert low < 1e6 < high


def test_the_nyquist_panel_is_full_and_drawn_in_silence(
    problem: TuningProblem, caplog: pytest.LogCaptureFixture
) -> None:
    figure = loop_figure(problem, Gains(0.1, 2.0, 0.0))
    figure.draw_without_rendering()
    panel, above, below = (next(x for x in figure.axes if x.get_ylabel().startswith(y)) for y in NYQUIST_AND_BESIDE)
    drawn, upper, lower = (x.get_position() for x in (panel, above, below))
    assert (drawn.y0, drawn.y1) == pytest.approx((lower.y0, upper.y1), abs=0.02)
    assert caplog.records == []


def test_settings_can_be_written_as_json() -> None:
    from dataclasses import asdict

    from bender_tuner.results.report import json_ready

    text = json.dumps(json_ready(asdict(TuneSettings())), allow_nan=False)
    assert json.loads(text)["slew_V_per_s"] is None
