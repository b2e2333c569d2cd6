"""Stability, margins and disturbances against closed-loop polynomials and scipy."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.signal import dlti, lfilter

from bender_loop.control.closed_loop import simulate
from bender_loop.control.pid import UNLIMITED, Gains
from bender_loop.control.plant import Plant
from bender_loop.control.references import Step
from bender_loop.control.sampling import Sampling
from bender_tuner.model.disturbances import UNREJECTED, load_rejection, load_response, noise_gain_V_per_um
from bender_tuner.model.loop_transfer import DelayedPlant, controller_response, is_stable, unstable_poles
from bender_tuner.model.margins import UNSTABLE, gain_margin, margins, sensitivity_peak
from bender_tuner.model.sampled_model import SampledModel

PERIOD = 1.0 / 30.0
NEAR_THE_CIRCLE = 1e-3


@dataclass(frozen=True)
class PolePlant:
    """A sampled plant b1/(z - p1) + b2/(z - p2), by its poles."""

    residues: tuple[float, float]
    poles: tuple[float, float]

    def polynomials(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        (b1, b2), (p1, p2) = self.residues, self.poles
        return np.array([b1 + b2, -b1 * p2 - b2 * p1]), np.array([1.0, -p1 - p2, p1 * p2])

    def model(self, length: int = 400) -> SampledModel:
        k = np.arange(length)
        (b1, b2), (p1, p2) = self.residues, self.poles
        return SampledModel(PERIOD, (b1 * p1**k + b2 * p2**k).astype(float))


def controller(gains: Gains, period_s: float = PERIOD) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Numerator and denominator of the PID block, in z."""
    tf = gains.filter_time_s
    integrator, filtered = np.array([1.0, -1.0]), np.array([tf + period_s, -tf])
    den = np.convolve(integrator, filtered)
    num = gains.proportional_V_per_um * den + gains.derivative_V_s_per_um * np.polymul(integrator, integrator)
    return num + gains.integral_V_per_um_s * period_s * np.polymul([1.0, 0.0], filtered), den


def closed_loop(
    gains: Gains, plant: PolePlant, latency: int
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
    """(open-loop denominator, open-loop numerator, closed-loop polynomial), all in z."""
    num, den = plant.polynomials()
    controller_num, controller_den = controller(gains)
    open_den = np.polymul(np.polymul(controller_den, den), np.eye(1, latency + 1).ravel())
    open_num = np.polymul(controller_num, num)
    return open_den, open_num, np.polyadd(open_den, open_num)


def random_case(seed: int) -> tuple[Gains, PolePlant, int]:
    rng = np.random.default_rng(seed)
    plant = PolePlant(tuple(rng.uniform(-0.3, 0.8, 2)), tuple(rng.uniform(-0.6, 0.95, 2)))
    kp, ki, kd = rng.uniform(0.0, [1.5, 12.0, 0.05])
    return Gains(kp, ki, kd, rng.choice([0.0, 0.07])), plant, int(rng.integers(0, 4))


@given(seed=st.integers(0, 10**6))
@settings(max_examples=150)
def test_unstable_poles_are_the_roots_outside_the_circle(seed: int) -> None:
    gains, plant, latency = random_case(seed)
    sizes = np.abs(np.roots(closed_loop(gains, plant, latency)[2]))
    assume(np.all(np.abs(sizes - 1.0) > NEAR_THE_CIRCLE))
    delayed = DelayedPlant(plant.model(), latency)
    assert unstable_poles(gains, delayed) == np.count_nonzero(sizes > 1.0)
    assert is_stable(gains, delayed) == bool(np.all(sizes < 1.0))


@given(seed=st.integers(0, 10**6))
@settings(max_examples=60)
def test_gain_margin_brings_a_root_to_the_circle(seed: int) -> None:
    gains, plant, latency = random_case(seed)
    open_den, open_num, closed = closed_loop(gains, plant, latency)
    assume(np.all(np.abs(np.roots(closed)) < 1.0 - NEAR_THE_CIRCLE))
    margin = gain_margin(gains, DelayedPlant(plant.model(), latency))
    assume(margin < 1e6)
    largest = np.max(np.abs(np.roots(np.polyadd(open_den, margin * open_num))))
    assert largest == pytest.approx(1.0, abs=1e-4)
    for smaller in np.linspace(1.0, 0.999 * margin, 5):
        assert np.max(np.abs(np.roots(np.polyadd(open_den, smaller * open_num)))) < 1.0


@given(seed=st.integers(0, 10**6))
@settings(max_examples=60)
def test_peaks_against_the_polynomials(seed: int) -> None:
    gains, plant, latency = random_case(seed)
    open_den, open_num, closed = closed_loop(gains, plant, latency)
    assume(np.all(np.abs(np.roots(closed)) < 1.0 - NEAR_THE_CIRCLE))
    delayed = DelayedPlant(plant.model(), latency)
    z = np.exp(1j * np.linspace(1e-5, math.pi, 20001))
    sensitivity = np.abs(np.polyval(open_den, z) / np.polyval(closed, z))
    complementary = np.abs(np.polyval(open_num, z) / np.polyval(closed, z))
    found = margins(gains, delayed)
    assert found.sensitivity_peak == pytest.approx(np.max(sensitivity), rel=2e-3)
    assert found.complementary_peak == pytest.approx(np.max(complementary), rel=2e-3)
    assert sensitivity_peak(gains, delayed) == pytest.approx(found.sensitivity_peak, rel=0.03)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=60)
def test_margins_obey_the_bounds_of_ms(seed: int) -> None:
    gains, plant, latency = random_case(seed)
    found = margins(gains, DelayedPlant(plant.model(), latency))
    assume(found.stable)
    peak = found.sensitivity_peak
    assert found.gain_margin >= peak / (peak - 1.0) - 1e-6
    assert found.phase_margin_deg >= math.degrees(2.0 * math.asin(0.5 / peak)) - 1e-6


def integrator(slope_um_per_V: float) -> SampledModel:
    """y[k] = y[k-1] + slope u[k-1]."""
    return SampledModel(PERIOD, np.full(20, slope_um_per_V), 1.0)


@pytest.mark.parametrize("slope", [0.05, 0.5, 1.5])
def test_proportional_control_of_an_integrator_in_closed_form(slope: float) -> None:
    # L = slope / (z - 1): the pole is 1 - slope; |L| = 1 where 2 sin(w/2) = slope, and arg L = -90 deg - w/2
    found = margins(Gains(1.0, 0.0), DelayedPlant(integrator(slope)))
    turn = 2.0 * math.asin(0.5 * slope)
    assert found.gain_margin == pytest.approx(2.0 / slope)
    assert found.crossover_rad_per_s == pytest.approx(turn / PERIOD)
    assert found.phase_margin_deg == pytest.approx(90.0 - math.degrees(0.5 * turn))
    assert found.delay_margin_s == pytest.approx(math.radians(found.phase_margin_deg) / found.crossover_rad_per_s)
    assert found.sensitivity_peak == pytest.approx(2.0 / (2.0 - slope))


def test_integral_control_of_an_integrator_needs_proportional_action() -> None:
    # one frame late: z (z-1)^2 + slope ((kp + ki T) z - kp); without P the roots are 1 +- j sqrt(slope ki T)
    plant = DelayedPlant(integrator(0.5), 1)
    assert unstable_poles(Gains(0.0, 3.0), plant) == 2
    assert is_stable(Gains(0.5, 1.0), plant)
    assert margins(Gains(0.0, 3.0), plant) == UNSTABLE


def test_delay_margin_is_the_latency_that_destabilises() -> None:
    gains, model = Gains(0.2, 6.0), PolePlant((0.6, 0.05), (0.1, 0.9)).model()
    frames = margins(gains, DelayedPlant(model)).delay_margin_s / PERIOD
    assert is_stable(gains, DelayedPlant(model, math.floor(frames)))
    assert not is_stable(gains, DelayedPlant(model, math.floor(frames) + 1))


def test_a_ringing_plant_is_counted_on_a_finer_grid() -> None:
    k = np.arange(1, 4000)
    model = SampledModel(PERIOD, 0.05 * 0.9985**k * np.sin(1.1 * k) + 0.3 * 0.5**k)
    coarse = DelayedPlant(model, 1, intervals=2048)
    gains = Gains(0.5, 3.0)
    assert unstable_poles(gains, coarse) == unstable_poles(gains, DelayedPlant(model, 1))


def test_no_crossover_means_no_phase_margin() -> None:
    found = margins(Gains(0.1, 0.0), DelayedPlant(PolePlant((0.3, 0.0), (0.5, 0.0)).model()))
    assert found.stable
    assert found.phase_margin_deg == math.inf
    assert math.isnan(found.crossover_rad_per_s)


def test_controller_response_of_pure_actions() -> None:
    omega = np.array([0.5, 5.0, 50.0])
    z = np.exp(1j * omega * PERIOD)
    assert controller_response(Gains(2.0, 0.0), PERIOD, omega) == pytest.approx(np.full(3, 2.0))
    assert controller_response(Gains(0.0, 3.0), PERIOD, omega) == pytest.approx(3.0 * PERIOD * z / (z - 1.0))
    slope = controller_response(Gains(0.0, 0.0, 4.0), PERIOD, omega)
    assert slope == pytest.approx(4.0 * (z - 1.0) / z / PERIOD)
    on_error = replace(Gains(0.3, 1.0, 0.2, 0.1), derivative_on_error=True)
    assert controller_response(on_error, PERIOD, omega) == pytest.approx(
        controller_response(Gains(0.3, 1.0, 0.2, 0.1), PERIOD, omega)
    )


def test_latency_is_checked() -> None:
    with pytest.raises(ValueError, match="latency_frames"):
        DelayedPlant(integrator(0.5), -1)


def swept(
    gains: Gains, plant: PolePlant, latency: int
) -> tuple[NDArray[np.floating], NDArray[np.complex128], NDArray[np.intp]]:
    """(angular frequencies, L there, the indices before each crossing of |L| = 1), from the polynomials."""
    open_den, open_num, _ = closed_loop(gains, plant, latency)
    angle = np.linspace(1e-5, math.pi, 400_001)
    z = np.exp(1j * angle)
    loop = np.asarray(np.polyval(open_num, z) / np.polyval(open_den, z), dtype=np.complex128)
    return angle / PERIOD, loop, np.flatnonzero(np.diff(np.signbit(np.abs(loop) - 1.0)))


@pytest.mark.slow
def test_of_several_crossovers_the_worst_counts() -> None:
    several = 0
    for seed in range(600):
        gains, plant, latency = random_case(seed)
        closed = closed_loop(gains, plant, latency)[2]
        if np.max(np.abs(np.roots(closed))) > 1.0 - NEAR_THE_CIRCLE:
            continue
        omega, loop, at = swept(gains, plant, latency)
        if at.size < 2:
            continue
        several += 1
        lags = np.mod(math.pi + np.angle(loop[at]), 2.0 * math.pi)
        found = margins(gains, DelayedPlant(plant.model(), latency))
        assert found.phase_margin_deg == pytest.approx(math.degrees(np.min(lags)), abs=0.05)
        assert found.delay_margin_s == pytest.approx(np.min(lags / omega[at]), rel=2e-3)
        assert found.crossover_rad_per_s == pytest.approx(omega[at[0]], rel=2e-3)
    assert several >= 3


@pytest.mark.slow
@given(seed=st.integers(0, 10**6))
@settings(max_examples=25, deadline=None)
def test_peaks_lie_between_the_points_of_a_coarse_grid_too(seed: int) -> None:
    gains, plant, latency = random_case(seed)
    assume(np.max(np.abs(np.roots(closed_loop(gains, plant, latency)[2]))) < 0.97)
    _, loop, _ = swept(gains, plant, latency)
    fine, coarse = (margins(gains, DelayedPlant(plant.model(), latency, intervals=n)) for n in (8192, 256))
    assert fine.complementary_peak == pytest.approx(np.max(np.abs(loop / (1.0 + loop))), rel=1e-5)
    assert coarse.complementary_peak == pytest.approx(fine.complementary_peak, rel=1e-4)
    assert coarse.sensitivity_peak == pytest.approx(fine.sensitivity_peak, rel=1e-4)


TICK_S = 0.02
POLE, GAIN = 0.8, 0.3
MODEL = SampledModel(TICK_S, np.array([GAIN * POLE**k for k in range(300)]))
GAINS = Gains(0.4, 5.0, 0.01, 0.05)
LATENCY = 1
UNSTABLE_GAINS = Gains(20.0, 5.0)


PLANT_NUM, PLANT_DEN = np.array([0.0, 0.0, GAIN]), np.array([1.0, -POLE, 0.0])


def test_noise_gain_is_the_norm_of_the_impulse_response() -> None:
    num, den = controller(GAINS, TICK_S)
    closed = np.convolve(den, PLANT_DEN) + np.convolve(num, PLANT_NUM)
    pulse = np.zeros(4000)
    pulse[0] = 1.0
    command = np.asarray(lfilter(np.convolve(num, PLANT_DEN), closed, pulse))
    expected = math.sqrt(float(command @ command))
    assert noise_gain_V_per_um(GAINS, DelayedPlant(MODEL, LATENCY)) == pytest.approx(expected, rel=1e-4)


def test_noise_gain_of_a_simulated_loop(linear_plant: Callable[..., Plant]) -> None:
    tau = -TICK_S / math.log(POLE)
    plant = linear_plant([GAIN / (1.0 - POLE)], [tau, 1.0])
    sampling = Sampling(1.0 / TICK_S, LATENCY, noise_um=0.1)
    trace = simulate(plant, GAINS, UNLIMITED, Step(10.0), sampling, 400.0, np.random.default_rng(8))
    found = float(np.std(trace.voltage_V[500:])) / 0.1
    assert noise_gain_V_per_um(GAINS, DelayedPlant(MODEL, LATENCY)) == pytest.approx(found, rel=0.05)


def test_load_response_against_scipy() -> None:
    num, den = controller(GAINS, TICK_S)
    closed = np.convolve(den, PLANT_DEN) + np.convolve(num, PLANT_NUM)
    # the load passes the plant alone, one sample late; the latency lies behind the reading
    expected = lfilter(np.convolve(den, [0.0, GAIN, 0.0]), closed, np.ones(120))
    assert load_response(GAINS, MODEL, LATENCY, 120) == pytest.approx(np.asarray(expected), abs=1e-9)


def test_integrated_error_is_the_inverse_of_the_integral_gain() -> None:
    rejection = load_rejection(GAINS, DelayedPlant(MODEL, LATENCY))
    response = load_response(GAINS, MODEL, LATENCY, 3000)
    assert rejection.integrated_error_um_s_per_V == pytest.approx(float(np.sum(response)) * TICK_S, rel=1e-6)
    assert rejection.peak_um_per_V == pytest.approx(float(np.max(response)))
    assert rejection.peak_time_s == pytest.approx(int(np.argmax(response)) * TICK_S)


def test_without_integral_the_error_stays() -> None:
    rejection = load_rejection(Gains(0.4, 0.0), DelayedPlant(MODEL, LATENCY))
    assert rejection.integrated_error_um_s_per_V == math.inf
    dc = dlti([GAIN], [1.0, -POLE], dt=TICK_S).freqresp([1e-9])[1][0].real
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
