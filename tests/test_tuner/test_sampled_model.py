import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import dlti, dstep

from bender_tuner.model.sampled_model import SampledModel, model_from_step

PERIOD = 0.02
OMEGA = np.geomspace(0.1, math.pi / PERIOD, 40)


def discrete(numerator: list[float], denominator: list[float], count: int) -> tuple[Any, np.ndarray]:
    """A transfer function in z and its unit step response at samples 0..count-1, by scipy."""
    responses: Any = dstep((numerator, denominator, PERIOD), n=count)[1]
    return dlti(numerator, denominator, dt=PERIOD), np.squeeze(responses[0])


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [
        ([0.5], [1.0, -0.9]),
        ([0.4, 0.1], [1.0, -1.2, 0.52]),
        ([0.8, -0.75], [1.0, -0.97, 0.0]),
        ([0.3], [1.0, 0.0, 0.0]),
    ],
)
@pytest.mark.parametrize("count", [60, 400])
def test_frequency_response_of_known_systems(numerator: list[float], denominator: list[float], count: int) -> None:
    system, step = discrete(numerator, denominator, count)
    model = model_from_step(PERIOD, step)
    expected = system.freqresp(OMEGA * PERIOD)[1]
    assert model.frequency_response(OMEGA) == pytest.approx(expected, abs=2e-4)
    assert model.dc_gain_um_per_V == pytest.approx(sum(numerator) / sum(denominator), rel=1e-3)


def test_a_relaxation_cut_off_halfway_is_continued() -> None:
    system, step = discrete([0.8, -0.79], [1.0, -0.995, 0.0], 100)
    model = model_from_step(PERIOD, step)
    assert model.tail_ratio == pytest.approx(0.995, rel=1e-9)
    assert model.frequency_response(OMEGA) == pytest.approx(system.freqresp(OMEGA * PERIOD)[1], rel=1e-9)
    longer = discrete([0.8, -0.79], [1.0, -0.995, 0.0], 300)[1]
    assert model.step_response(300) == pytest.approx(longer, rel=1e-9)


def test_an_integrating_plant_is_recognised() -> None:
    system, step = discrete([0.5], [1.0, -1.0], 50)
    model = model_from_step(PERIOD, step)
    assert model.tail_ratio == 1.0
    assert model.dc_gain_um_per_V == math.inf
    assert model.frequency_response(OMEGA) == pytest.approx(system.freqresp(OMEGA * PERIOD)[1], rel=1e-9)


def test_ringing_and_noise_have_no_tail() -> None:
    k = np.arange(1, 80)
    assert model_from_step(PERIOD, np.append(0.0, np.cumsum(0.97**k * np.cos(0.9 * k)))).tail_ratio == 0.0
    noise = np.random.default_rng(2).normal(size=80)
    assert model_from_step(PERIOD, np.cumsum(noise)).tail_ratio == 0.0


def test_uniform_response_is_the_frequency_response() -> None:
    model = model_from_step(PERIOD, discrete([0.4, 0.1], [1.0, -1.2, 0.52], 200)[1])
    uniform = model.uniform_response(256)
    omega = math.pi / PERIOD * np.arange(257) / 256
    assert uniform[1:] == pytest.approx(model.frequency_response(omega[1:]), abs=1e-12)
    assert uniform[0] == pytest.approx(model.dc_gain_um_per_V)
    with pytest.raises(ValueError, match="intervals must exceed"):
        model.uniform_response(99)


@given(factor=st.floats(0.01, 100.0))
def test_scaling_the_plant_scales_its_response(factor: float) -> None:
    model = SampledModel(PERIOD, np.array([0.5, 0.2, 0.1]), 0.5)
    assert model.scaled(factor).frequency_response(OMEGA) == pytest.approx(
        factor * model.frequency_response(OMEGA), rel=1e-12
    )
    assert model.scaled(factor).dc_gain_um_per_V == pytest.approx(factor * model.dc_gain_um_per_V)


def test_a_delay_of_the_step_delays_the_model() -> None:
    step = discrete([0.5], [1.0, -0.9], 200)[1]
    early, late = model_from_step(PERIOD, step), model_from_step(PERIOD, np.append([0.0, 0.0, 0.0], step))
    turned = early.frequency_response(OMEGA) * np.exp(-3j * OMEGA * PERIOD)
    assert late.frequency_response(OMEGA) == pytest.approx(turned, abs=1e-7)


def test_settings_are_checked() -> None:
    with pytest.raises(ValueError, match="period_s"):
        SampledModel(0.0, np.ones(3))
    with pytest.raises(ValueError, match="pulse_um_per_V"):
        SampledModel(PERIOD, np.array([1.0, math.nan]))
    with pytest.raises(ValueError, match="pulse_um_per_V"):
        SampledModel(PERIOD, np.array([]))
    with pytest.raises(ValueError, match="tail_ratio"):
        SampledModel(PERIOD, np.ones(3), 1.1)


def test_a_model_keeps_its_own_copy() -> None:
    pulse = np.ones(3)
    model = SampledModel(PERIOD, pulse)
    pulse[0] = 7.0
    assert model.dc_gain_um_per_V == 3.0
    with pytest.raises(ValueError, match="read-only"):
        model.pulse_um_per_V[0] = 1.0
