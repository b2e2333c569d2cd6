"""Plants drawn at random, and how unstable ones are told."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from bender_loop.control.pid import Gains, Limits
from bender_loop.control.sampling import Sampling
from bender_loop.control.trace import Trace
from bender_tuner.model.monte_carlo import Variation, draw_plants, is_unstable, run_monte_carlo, uniform
from bender_tuner.task.experiment import StepExperiment

LIMITS = Limits(0.0, 50.0)
SAMPLING = Sampling(30.0, 1)
SIMC = Gains(0.0, 6.0)


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
