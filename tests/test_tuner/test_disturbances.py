import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import dlti, lfilter

from bender_loop.control.closed_loop import simulate
from bender_loop.control.pid import UNLIMITED, Gains
from bender_loop.control.plant import Plant
from bender_loop.control.references import Step
from bender_loop.control.sampling import Sampling
from bender_tuner.model.disturbances import UNREJECTED, load_rejection, load_response, noise_gain_V_per_um
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.sampled_model import SampledModel

PERIOD = 0.02
POLE, GAIN = 0.8, 0.3
MODEL = SampledModel(PERIOD, np.array([GAIN * POLE**k for k in range(300)]))
GAINS = Gains(0.4, 5.0, 0.01, 0.05)
LATENCY = 1
UNSTABLE_GAINS = Gains(20.0, 5.0)


def polynomials(gains: Gains) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Numerator and denominator of C and of z^-1 G, in 1/z and of equal length."""
    tf, T = gains.filter_time_s, PERIOD
    difference, filtered = np.array([1.0, -1.0]), np.array([tf + T, -tf])
    den = np.convolve(difference, filtered)
    num = gains.proportional_V_per_um * den
    num[:2] += gains.integral_V_per_um_s * T * filtered
    num += gains.derivative_V_s_per_um * np.convolve(difference, difference)
    return num, den, np.array([0.0, 0.0, GAIN]), np.array([1.0, -POLE, 0.0])


def test_noise_gain_is_the_norm_of_the_impulse_response() -> None:
    num, den, plant_num, plant_den = polynomials(GAINS)
    closed = np.convolve(den, plant_den) + np.convolve(num, plant_num)
    pulse = np.zeros(4000)
    pulse[0] = 1.0
    command = np.asarray(lfilter(np.convolve(num, plant_den), closed, pulse))
    expected = math.sqrt(float(command @ command))
    assert noise_gain_V_per_um(GAINS, DelayedPlant(MODEL, LATENCY)) == pytest.approx(expected, rel=1e-4)


def test_noise_gain_of_a_simulated_loop(linear_plant: Callable[..., Plant]) -> None:
    tau = -PERIOD / math.log(POLE)
    plant = linear_plant([GAIN / (1.0 - POLE)], [tau, 1.0])
    sampling = Sampling(1.0 / PERIOD, LATENCY, noise_um=0.1)
    trace = simulate(plant, GAINS, UNLIMITED, Step(10.0), sampling, 400.0, np.random.default_rng(8))
    found = float(np.std(trace.voltage_V[500:])) / 0.1
    assert noise_gain_V_per_um(GAINS, DelayedPlant(MODEL, LATENCY)) == pytest.approx(found, rel=0.05)


def test_load_response_against_scipy() -> None:
    num, den, _, plant_den = polynomials(GAINS)
    closed = np.convolve(den, plant_den) + np.convolve(num, [0.0, 0.0, GAIN])
    # the load passes the plant alone, one sample late; the latency lies behind the reading
    expected = lfilter(np.convolve(den, [0.0, GAIN, 0.0]), closed, np.ones(120))
    assert load_response(GAINS, MODEL, LATENCY, 120) == pytest.approx(np.asarray(expected), abs=1e-9)


def test_integrated_error_is_the_inverse_of_the_integral_gain() -> None:
    rejection = load_rejection(GAINS, DelayedPlant(MODEL, LATENCY))
    response = load_response(GAINS, MODEL, LATENCY, 3000)
    assert rejection.integrated_error_um_s_per_V == pytest.approx(float(np.sum(response)) * PERIOD, rel=1e-6)
    assert rejection.peak_um_per_V == pytest.approx(float(np.max(response)))
    assert rejection.peak_time_s == pytest.approx(int(np.argmax(response)) * PERIOD)


def test_without_integral_the_error_stays() -> None:
    rejection = load_rejection(Gains(0.4, 0.0), DelayedPlant(MODEL, LATENCY))
    assert rejection.integrated_error_um_s_per_V == math.inf
    dc = dlti([GAIN], [1.0, -POLE], dt=PERIOD).freqresp([1e-9])[1][0].real
    last = load_response(Gains(0.4, 0.0), MODEL, LATENCY, 300)[-1]
    assert last == pytest.approx(dc / (1.0 + 0.4 * dc), rel=1e-6)


def test_an_unstable_loop_has_no_figures() -> None:
    plant = DelayedPlant(MODEL, LATENCY)
    assert noise_gain_V_per_um(UNSTABLE_GAINS, plant) == math.inf
    assert load_rejection(UNSTABLE_GAINS, plant) == UNREJECTED


@given(factor=st.floats(0.1, 10.0))
def test_gain_moved_from_plant_to_controller(factor: float) -> None:
    scaled = Gains(
        factor * GAINS.proportional_V_per_um,
        factor * GAINS.integral_V_per_um_s,
        factor * GAINS.derivative_V_s_per_um,
        GAINS.filter_time_s,
    )
    one, other = DelayedPlant(MODEL, LATENCY), DelayedPlant(MODEL.scaled(1.0 / factor), LATENCY)
    assert noise_gain_V_per_um(scaled, other) == pytest.approx(factor * noise_gain_V_per_um(GAINS, one), rel=1e-9)
    assert load_rejection(scaled, other).peak_um_per_V == pytest.approx(
        load_rejection(GAINS, one).peak_um_per_V / factor, rel=1e-9
    )
