"""What a search judges: objectives and ensemble, the box that is searched, plants drawn at random."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from few import few_rows
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.control.closed_loop import simulate
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.plant import Plant
from bender_loop.control.references import Step
from bender_loop.control.sampling import Sampling
from bender_loop.control.trace import Trace
from bender_loop.errors import InputError
from bender_tuner.model.ensemble import Ensemble, build_ensemble
from bender_tuner.model.monte_carlo import (
    BENDER_PARAMETERS,
    Variation,
    draw_plants,
    is_unstable,
    run_monte_carlo,
    uniform,
)
from bender_tuner.model.reduced_model import reduce_model
from bender_tuner.results.report import robustness_report
from bender_tuner.rules.simc import simc
from bender_tuner.task.experiment import StepExperiment
from bender_tuner.task.objectives import at_point, itae, mean_squared_error
from bender_tuner.task.practitioner import PractitionerObjective, Priorities
from bender_tuner.task.search_space import RawSpace, SearchSpace

LIMITS = Limits(0.0, 50.0)
SAMPLING = Sampling(30.0, 1)
SIMC = Gains(0.0, 6.0)
HARSH = Gains(0.9, 25.0)


@pytest.fixture
def ensemble(lag: Plant) -> Ensemble:
    return build_ensemble(lag, 10.0, SAMPLING, LIMITS)


def by_hand(plant: Plant, gains: Gains) -> Trace:
    return simulate(plant, gains, LIMITS, Step(10.0), SAMPLING, 2.0)


def test_mean_squared_error_is_equation_28(experiment: StepExperiment, lag: Plant) -> None:
    error = 10.0 - by_hand(lag, SIMC).displacement_um
    expected = sum(float(e) ** 2 for e in error) / len(error)
    value, metrics = mean_squared_error(experiment).evaluate(SIMC)
    assert value == pytest.approx(expected)
    assert metrics.overshoot_percent == 0.0
    assert mean_squared_error(experiment)(SIMC) == value


def test_itae_is_the_area_under_time_times_error(experiment: StepExperiment, lag: Plant) -> None:
    trace = by_hand(lag, SIMC)
    weighted = trace.time_s * np.abs(10.0 - trace.displacement_um)
    expected = float(np.sum(weighted[1:] + weighted[:-1])) / 60.0
    assert itae(experiment)(SIMC) == pytest.approx(expected)


def test_time_between_the_frames_is_judged_where_it_is_shown(experiment: StepExperiment) -> None:
    fine = replace(experiment, sampling=replace(SAMPLING, substeps=20))
    assert itae(fine)(SIMC) != pytest.approx(itae(experiment)(SIMC), rel=1e-3)


def test_noise_is_the_same_in_every_run(experiment: StepExperiment) -> None:
    noisy = replace(experiment, sampling=replace(SAMPLING, noise_um=0.1), seed=3)
    assert itae(noisy)(SIMC) == itae(noisy)(SIMC)
    assert itae(noisy)(SIMC) != itae(replace(noisy, seed=4))(SIMC)


def test_points_that_are_no_gains_are_infinitely_bad(experiment: StepExperiment) -> None:
    objective = itae(experiment)
    assert at_point(objective, RawSpace(), [0.1, -0.1, 0.0]) == math.inf
    assert at_point(objective, SearchSpace(Gains(0.2, 6.0, 0.01)), [math.nan, 0.5, 0.5]) == math.inf
    assert at_point(objective, RawSpace((1.0, 6.0, 1.0)), [0.0, 1.0, 0.0]) == pytest.approx(
        objective(replace(SIMC, derivative_on_error=True))
    )


def test_a_runaway_is_infinitely_bad(linear_plant: Callable[..., Plant]) -> None:
    runaway = StepExperiment(linear_plant([1.0], [-0.01, 1.0]), Limits(-1e9, 1e9), 10.0, SAMPLING, 2.0)
    assert mean_squared_error(runaway)(SIMC) == math.inf
    assert itae(runaway)(SIMC) == math.inf


@pytest.mark.parametrize("setpoint_um", [0.0, math.nan])
def test_setpoint_is_checked(lag: Plant, setpoint_um: float) -> None:
    with pytest.raises(ValueError, match="setpoint_um"):
        StepExperiment(lag, LIMITS, setpoint_um, SAMPLING, 2.0)
    with pytest.raises(ValueError, match="duration_s"):
        StepExperiment(lag, LIMITS, 10.0, SAMPLING, 0.01)


def test_ensemble_holds_every_gain_with_every_latency(ensemble: Ensemble) -> None:
    cases = {(case.gain_factor, case.latency_frames) for case in ensemble.cases}
    assert cases == {(gain, frames) for gain in (0.7, 1.0, 1.3) for frames in (1, 2)}
    for case in ensemble.cases:
        assert case.linearisation.point.voltage_V == pytest.approx(10.0 / (0.8 * case.gain_factor), rel=2e-3)
        assert case.linearisation.model.dc_gain_um_per_V == pytest.approx(0.8 * case.gain_factor, rel=2e-3)
    assert (ensemble.nominal.gain_factor, ensemble.nominal.latency_frames) == (1.0, 1)


def test_ensemble_checks_what_it_is_given(lag: Plant) -> None:
    with pytest.raises(ValueError, match="gain_factors"):
        build_ensemble(lag, 10.0, SAMPLING, LIMITS, gain_factors=(0.7, 1.3))
    with pytest.raises(ValueError, match="extra_frames"):
        build_ensemble(lag, 10.0, SAMPLING, LIMITS, extra_frames=(1,))
    with pytest.raises(InputError, match="out of reach"):
        build_ensemble(lag, 35.0, SAMPLING, LIMITS)


def test_value_is_what_the_report_adds_up_to(experiment: StepExperiment, ensemble: Ensemble) -> None:
    report = PractitionerObjective(experiment, ensemble).evaluate(SIMC)
    scores = [case.score for case in report.cases]
    assert report.tracking == pytest.approx(0.7 * max(scores) + 0.3 * sum(scores) / 6.0)
    assert report.value == report.tracking + report.penalty
    assert (report.nominal.gain_factor, report.nominal.latency_frames) == (1.0, 1)
    # by hand for one case: the scale is 2.5 theta^2 r
    theta = reduce_model(ensemble.nominal.linearisation.model, 1).delay_s
    assert report.nominal.score == pytest.approx(
        report.nominal.metrics.itae_um_s2 / (2.5 * theta**2 * 10.0)
        + 0.25 * max(0.0, report.nominal.metrics.total_variation_V / 12.5 - 1.2)
        + 5.0 * abs(report.nominal.metrics.steady_state_error_um) / 10.0,
        rel=2e-3,
    )


def test_simc_on_the_nominal_plant_scores_about_one(experiment: StepExperiment, ensemble: Ensemble) -> None:
    gains = simc(reduce_model(ensemble.nominal.linearisation.model, 1))
    assert 0.5 < PractitionerObjective(experiment, ensemble).evaluate(gains).nominal.score < 1.5


def test_bounds_are_penalised_and_only_beyond(experiment: StepExperiment, ensemble: Ensemble) -> None:
    objective = PractitionerObjective(experiment, ensemble)
    kept, broken = objective.evaluate(Gains(0.0, 4.0)), objective.evaluate(Gains(0.0, 9.0))
    assert kept.penalty == 0.0
    assert kept.bounds_kept
    assert kept.worst_sensitivity_peak < 1.6
    assert not broken.bounds_kept
    peak = (broken.worst_sensitivity_peak - 1.6) / 0.1
    overshoot = max(0.0, broken.nominal.metrics.overshoot_percent / 100.0 - 0.01) / 0.01
    assert peak > 1.0
    assert broken.penalty == pytest.approx(0.5 * max(broken.tracking, 1.0) * (peak**2 + overshoot**2))


def test_a_wider_bound_costs_less(experiment: StepExperiment, ensemble: Ensemble) -> None:
    values = [
        PractitionerObjective(experiment, ensemble, Priorities(sensitivity_bound=bound, sensitivity_comfort=1.3))(
            Gains(0.0, 9.0)
        )
        for bound in (1.4, 1.7, 2.5)
    ]
    assert values == sorted(values, reverse=True)


def test_unstable_gains_are_worse_than_any_stable_ones(experiment: StepExperiment, ensemble: Ensemble) -> None:
    objective = PractitionerObjective(experiment, ensemble)
    assert objective(HARSH) > 100.0 > objective(SIMC)
    assert math.isfinite(objective(HARSH))


def test_the_targets_of_the_30_hz_loop_can_be_met(relaxing_plant: Callable[[], Any]) -> None:
    # gains that a search found on this loop: the objective prefers them to SIMC, and they do what they should
    tuned = Gains(0.036, 7.38, 0.0143, 2.0 / 30.0)
    plant, sampling = relaxing_plant(), replace(SAMPLING, exposure_s=0.015, substeps=5)
    experiment = StepExperiment(plant, LIMITS, 10.0, sampling, 2.0)
    ensemble = build_ensemble(plant, 10.0, sampling, LIMITS)
    objective = PractitionerObjective(experiment, ensemble)
    found = objective.evaluate(tuned)
    assert found.bounds_kept
    assert found.worst_sensitivity_peak <= 1.7
    assert found.nominal.metrics.overshoot_percent <= 2.0
    assert found.nominal.metrics.rise_time_s <= 0.30
    assert found.nominal.metrics.settling_time_s <= 0.60
    assert found.value <= 0.9 * objective(simc(reduce_model(ensemble.nominal.linearisation.model, 1)))
    variation = Variation(parameters=BENDER_PARAMETERS).only(plant.parameters)
    longer = replace(experiment, duration_s=6.0)
    assert run_monte_carlo(plant, tuned, longer, variation, 30, np.random.default_rng(2)).unstable == 0


@pytest.mark.parametrize(("um", "s"), few_rows([(0.5, 1.0), (1.0, 0.1), (2.0, 1.0), (1.0, 4.0)], 0, 1))
def test_units_of_displacement_and_of_time_do_not_matter(linear_plant: Callable[..., Plant], um: float, s: float):
    values = []
    for length, time in ((1.0, 1.0), (um, s)):
        plant, sampling = linear_plant([0.8 * length], [0.02 * time, 1.0]), Sampling(30.0 / time, latency_frames=1)
        experiment = StepExperiment(plant, LIMITS, 10.0 * length, sampling, 2.0 * time)
        ensemble = build_ensemble(plant, 10.0 * length, sampling, LIMITS)
        gains = Gains(0.1 / length, 7.0 / (length * time), 0.01 * time / length, 0.07 * time)
        values.append(PractitionerObjective(experiment, ensemble)(gains))
    assert values[1] == pytest.approx(values[0], rel=1e-6 if s == 1.0 else 1e-3)


@pytest.mark.parametrize(
    "settings",
    [{"sensitivity_bound": 1.5}, {"overshoot_comfort": -0.1}, {"worst_share": 1.1}, {"effort_weight": math.nan}],
)
def test_priorities_are_checked(settings: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(settings))):
        Priorities(**settings)


def test_report_agrees_with_the_objective(experiment: StepExperiment, ensemble: Ensemble) -> None:
    report = robustness_report(SIMC, ensemble)
    objective = PractitionerObjective(experiment, ensemble).evaluate(SIMC)
    assert report.worst_sensitivity_peak == pytest.approx(objective.worst_sensitivity_peak, rel=1e-3)
    assert report.unstable_cases == 0
    assert report.load_rejection.integrated_error_um_s_per_V == pytest.approx(1.0 / 6.0)
    assert report.nominal in [case.margins for case in report.cases]


def test_report_is_json_even_for_an_unstable_loop(ensemble: Ensemble) -> None:
    report = robustness_report(HARSH, ensemble)
    assert report.unstable_cases > 0
    table = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert table["worst_sensitivity_peak"] is None
    assert len(table["cases"]) == 6


CENTER = Gains(0.25, 6.0, 0.002, filter_time_s=0.07)
UNIT = st.floats(0.0, 1.0)
GAIN = st.floats(1e-6, 1e4)


def test_the_centre_is_the_guess_and_the_edges_lie_the_decades_away() -> None:
    space = SearchSpace(CENTER, decades=2.0)
    assert space.to_gains([0.5, 0.5, 0.5]) == CENTER
    edge = space.to_gains([1.0, 0.0, 0.5])
    assert edge.proportional_V_per_um == pytest.approx(25.0)
    assert edge.integral_V_per_um_s == pytest.approx(0.06)
    assert edge.filter_time_s == 0.07


@given(x=st.tuples(UNIT, UNIT, UNIT))
def test_points_come_back_from_their_gains(x: tuple[float, float, float]) -> None:
    space = SearchSpace(CENTER)
    assert space.from_gains(space.to_gains(x)) == pytest.approx(np.array(x), abs=1e-12)


@given(factor=st.floats(0.05, 20.0), x=st.tuples(UNIT, UNIT, UNIT))
def test_scaling_the_centre_scales_all_gains(factor: float, x: tuple[float, float, float]) -> None:
    scaled = Gains(0.25 * factor, 6.0 * factor, 0.002 * factor)
    one, other = SearchSpace(CENTER).to_gains(x), SearchSpace(scaled).to_gains(x)
    assert other.integral_V_per_um_s == pytest.approx(factor * one.integral_V_per_um_s)
    assert other.derivative_V_s_per_um == pytest.approx(factor * one.derivative_V_s_per_um)


def test_gains_outside_the_box_lie_outside_and_zero_infinitely_far() -> None:
    x = SearchSpace(CENTER).from_gains(Gains(0.0, 6.0, 0.2))
    assert x[0] == -math.inf
    assert x[1] == pytest.approx(0.5)
    assert x[2] > 1.0


@pytest.mark.parametrize("x", [[0.5, 0.5], [0.5, 0.5, 1.01], [-0.01, 0.5, 0.5], [0.5, math.nan, 0.5]])
def test_points_outside_the_cube_are_refused(x: list[float]) -> None:
    with pytest.raises(ValueError, match="x must"):
        SearchSpace(CENTER).to_gains(x)


def test_a_last_digit_beyond_the_edge_is_the_edge() -> None:
    space = SearchSpace(CENTER)
    assert space.to_gains([1.0 + 1e-12, 0.0, 0.0]) == space.to_gains([1.0, 0.0, 0.0])


def test_settings_are_checked() -> None:
    with pytest.raises(ValueError, match=r"center\.proportional_V_per_um must be > 0"):
        SearchSpace(Gains(0.0, 1.0, 1.0))
    with pytest.raises(ValueError, match="decades"):
        SearchSpace(CENTER, decades=0.0)
    with pytest.raises(ValueError, match="scale"):
        RawSpace((1.0, 0.0, 1.0))


@given(gains=st.tuples(GAIN, GAIN, GAIN))
def test_raw_space_is_linear_and_without_upper_bound(gains: tuple[float, float, float]) -> None:
    space = RawSpace((2.0, 10.0, 0.5))
    found = space.to_gains(np.array(gains) / np.array([2.0, 10.0, 0.5]))
    assert found.proportional_V_per_um == pytest.approx(gains[0])
    assert space.from_gains(found) == pytest.approx(np.array(gains) / np.array([2.0, 10.0, 0.5]))
    assert found.derivative_on_error
    assert found.filter_time_s == 0.0


class Recorder:
    """A static plant that notes its parameters."""

    def __init__(self) -> None:
        self.parameters: list[Mapping[str, float]] = []

    def set_parameters(self, parameters: Mapping[str, float]) -> None:
        self.parameters.append(dict(parameters))

    def reset(self) -> None:
        pass

    def step(self, voltage_V: float, step_s: float) -> float:
        return 0.8 * voltage_V

    def close(self) -> None:
        pass


VARIATION = Variation(parameters={"lag": uniform(0.01, 0.1), "unknown": uniform(1.0, 1.0)})


def test_draws_cover_their_ranges_and_follow_the_seed() -> None:
    draws = draw_plants(VARIATION, 300, np.random.default_rng(5))
    assert draws == draw_plants(VARIATION, 300, np.random.default_rng(5))
    factors = [draw.gain_factor for draw in draws]
    assert 0.7 <= min(factors) < 0.72
    assert 1.28 < max(factors) <= 1.3
    assert {draw.latency_frames for draw in draws} == {1, 2}
    assert all(0.01 <= draw.parameters["lag"] <= 0.1 for draw in draws)
    assert len({draw.seed for draw in draws}) > 290


def test_every_plant_gets_its_parameters(experiment: StepExperiment) -> None:
    plant, seen = Recorder(), []
    result = run_monte_carlo(
        plant,
        SIMC,
        experiment,
        VARIATION.only({"lag"}),
        20,
        np.random.default_rng(5),
        progress=lambda done, count: seen.append((done, count)),
    )
    assert plant.parameters == [outcome.draw.parameters for outcome in result.outcomes]
    assert all(set(parameters) == {"lag"} for parameters in plant.parameters)
    assert seen == [(done, 20) for done in range(1, 21)]


def test_stable_and_unstable_plants_are_counted(experiment: StepExperiment) -> None:
    # a static plant of gain g, one frame late: z^2 (z - 1) + g ((kp + ki T) z - kp)
    longer = replace(experiment, duration_s=6.0)
    plant = Recorder()
    variation = Variation(latencies_frames=(1,), noise_um=0.0)
    calm = run_monte_carlo(plant, SIMC, longer, variation, 60, np.random.default_rng(1))
    assert calm.unstable == 0
    assert calm.quantile("settling_time_s", 0.95) < 2.0
    brisk = run_monte_carlo(plant, Gains(1.0, 1.0), longer, variation, 60, np.random.default_rng(1))
    for outcome in brisk.outcomes:
        gain = 0.8 * outcome.draw.gain_factor
        largest = float(np.max(np.abs(np.roots([1.0, -1.0, gain * (1.0 + 1.0 / 30.0), -gain]))))
        if abs(largest - 1.0) > 0.02:
            assert outcome.unstable == (largest > 1.0)
    assert 0 < brisk.unstable < 60
    assert brisk.quantile("settling_time_s", 1.0) == math.inf


def trace_of(displacement_um: np.ndarray, *, diverged: bool = False) -> Trace:
    time = np.arange(displacement_um.size) / 30.0
    return Trace(time, np.full_like(time, 10.0), displacement_um, displacement_um, displacement_um, diverged)


def test_what_counts_as_unstable() -> None:
    time = np.arange(180) / 30.0
    assert not is_unstable(trace_of(10.0 - 10.0 * np.exp(-time / 3.0)), 10.0, 0.0)
    assert not is_unstable(trace_of(10.0 - 10.0 * np.exp(-time) * np.cos(9.0 * time)), 10.0, 0.0)
    assert is_unstable(trace_of(10.0 + np.cos(9.0 * time)), 10.0, 0.0)
    assert not is_unstable(trace_of(10.0 + np.cos(9.0 * time)), 10.0, 0.5)
    assert is_unstable(trace_of(10.0 + 0.0 * time, diverged=True), 10.0, 0.0)


def test_variation_is_checked() -> None:
    with pytest.raises(ValueError, match="latencies_frames"):
        Variation(latencies_frames=())
    with pytest.raises(ValueError, match="noise_um"):
        Variation(noise_um=-1.0)
    with pytest.raises(ValueError, match="lower"):
        uniform(2.0, 1.0)
    with pytest.raises(ValueError, match="count"):
        draw_plants(VARIATION, 0, np.random.default_rng(0))
