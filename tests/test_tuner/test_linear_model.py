"""Linear models of plants: learned about an operating point, sampled, in matrices of few states."""

import math
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import cont2discrete, dlti, dstep, tf2ss

from bender_loop.control.pid import UNLIMITED, Gains, Limits
from bender_loop.control.plant import Plant
from bender_loop.control.sampling import Sampling
from bender_loop.errors import InputError
from bender_tuner.model.linear_model import OperatingPoint, find_operating_point, linearise, linearise_at, settle
from bender_tuner.model.loop_transfer import DelayedPlant, controller_response
from bender_tuner.model.margins import margins
from bender_tuner.model.python_control import controller_polynomials, to_control
from bender_tuner.model.sampled_model import SampledModel, model_from_step
from bender_tuner.model.scaled_plant import ScaledPlant
from bender_tuner.model.state_space import TOLERANCE, realise

LIMITS = Limits(0.0, 50.0)
SAMPLING = Sampling(30.0)
OMEGA = np.geomspace(0.2, math.pi * 30.0, 30)

SYSTEMS = {
    "lag": ([2.0], [0.5, 1.0]),
    "ringing beam": ([0.8 * 60.0**2], [1.0, 0.1 * 60.0, 60.0**2]),
    "lead of equation (30)": ([0.818, 1.652], [1.0, 3.18]),
    "static": ([0.7], [1.0]),
}


def sampled_by_scipy(system: tuple[list[float], list[float]], period_s: float) -> np.ndarray:
    """Response at OMEGA of the plant behind a hold, its reading taken before the voltage of the instant acts."""
    # the direct term of a proper plant answers within the period: it reaches the reading one sample later
    numerator, denominator = np.array(system[0]), np.array(system[1])
    direct = numerator[0] / denominator[0] if numerator.size == denominator.size else 0.0
    rest = np.polysub(numerator, direct * denominator)
    response = direct * np.exp(-1j * OMEGA * period_s)
    if np.any(rest != 0.0):
        sampled: Any = cont2discrete(tf2ss(np.trim_zeros(rest, "f"), denominator), period_s)
        A, B, C, *_ = sampled
        z = np.exp(1j * OMEGA * period_s)
        response = response + [(C @ np.linalg.solve(point * np.eye(A.shape[0]) - A, B)).item() for point in z]
    return response


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("voltage_V", [0.0, 20.0])
def test_linear_plants_against_scipy(linear_plant: Callable[..., Plant], name: str, voltage_V: float) -> None:
    plant = linear_plant(*SYSTEMS[name])
    point = settle(plant, voltage_V, SAMPLING)
    longer = OperatingPoint(voltage_V, point.displacement_um, max(point.frames, 200), point.settled)
    model = linearise(plant, longer, SAMPLING, step_V=0.5)
    assert model.frequency_response(OMEGA) == pytest.approx(sampled_by_scipy(SYSTEMS[name], 1.0 / 30.0), abs=1e-4)


def test_exposure_is_part_of_the_model(linear_plant: Callable[..., Plant]) -> None:
    tau, exposure, period = 0.05, 0.02, 1.0 / 30.0
    sampling = Sampling(30.0, exposure_s=exposure, substeps=100)
    model = linearise_at(linear_plant([1.0], [tau, 1.0]), 10.0, sampling, LIMITS).model
    # mean of 1 - exp(-t/tau) over the exposure that ends each frame
    ends = period * np.arange(1, 20)
    expected = 1.0 - tau / exposure * (np.exp(-(ends - exposure) / tau) - np.exp(-ends / tau))
    assert model.step_response(20)[1:] == pytest.approx(expected, abs=1e-5)


def test_operating_point_of_the_learned_hysteresis(relaxing_plant: Callable[[], Plant]) -> None:
    # at rest 0.124 w^2 + 0.70 w = 1.652 u, so 10 um need 11.743 V
    point = find_operating_point(relaxing_plant(), 10.0, SAMPLING, LIMITS)
    assert point.settled
    assert point.voltage_V == pytest.approx((0.124 * 100.0 + 7.0) / 1.652, rel=2e-3)
    assert point.displacement_um == pytest.approx(10.0, rel=1e-3)


def test_learned_hysteresis_is_a_lead_about_its_operating_point(relaxing_plant: Callable[[], Plant]) -> None:
    # dz/dt linearised at w = 10: (0.818 s + 1.652) / (s + 0.70 + 0.248 w), behind the supply's 20 ms
    slope = 0.70 + 2.48
    numerator, denominator = [0.818, 1.652], np.polymul([1.0, slope], [0.02, 1.0])
    expected = sampled_by_scipy((numerator, list(denominator)), 1.0 / 30.0)
    model = linearise_at(relaxing_plant(), 10.0, SAMPLING, LIMITS).model
    assert model.frequency_response(OMEGA) == pytest.approx(expected, abs=5e-3)
    assert model.dc_gain_um_per_V == pytest.approx(1.652 / slope, rel=5e-3)


def test_a_drift_leaves_the_model_alone(linear_plant: Callable[..., Plant]) -> None:
    still, drifting = (linear_plant([1.0], [0.1, 1.0], drift) for drift in (0.0, 0.3))
    point = OperatingPoint(5.0, 5.0, 60, True)
    models = [linearise(plant, point, SAMPLING, step_V=0.5) for plant in (still, drifting)]
    assert models[1].pulse_um_per_V == pytest.approx(models[0].pulse_um_per_V, abs=1e-10)
    assert not settle(drifting, 0.0, Sampling(1000.0)).settled


def test_scaled_plant_scales_its_model(linear_plant: Callable[..., Plant]) -> None:
    plant = linear_plant([1.0], [0.1, 1.0])
    point = OperatingPoint(5.0, 5.0, 60, True)
    one = linearise(plant, point, SAMPLING, step_V=0.5)
    other = linearise(ScaledPlant(plant, 0.7), point, SAMPLING, step_V=0.5)
    assert other.pulse_um_per_V == pytest.approx(0.7 * one.pulse_um_per_V, abs=1e-12)
    with pytest.raises(ValueError, match="factor"):
        ScaledPlant(plant, 0.0)


@pytest.mark.parametrize("setpoint_um", [-1.0, 60.0])
def test_a_setpoint_out_of_reach_is_named(linear_plant: Callable[..., Plant], setpoint_um: float) -> None:
    with pytest.raises(InputError, match=r"out of reach: between 0 and 50 V .* 0 and 50 µm"):
        find_operating_point(linear_plant([1.0], [0.1, 1.0]), setpoint_um, SAMPLING, LIMITS)


@pytest.mark.parametrize(("times", "asked"), [(1000.0, "mm for µm"), (1.4, "")])
def test_a_setpoint_a_power_of_ten_out_of_reach_may_be_one_of_another_unit(
    linear_plant: Callable[..., Plant], times: float, asked: str
) -> None:
    with pytest.raises(InputError) as refused:
        find_operating_point(linear_plant([1.0], [0.1, 1.0]), 50.0 * times, SAMPLING, LIMITS)
    remedy = str(refused.value).partition("other bounds of the command (--voltage-limits)")[2]
    assert asked in remedy if asked else remedy == ""


def test_the_ends_of_the_range_are_within_reach(linear_plant: Callable[..., Plant]) -> None:
    plant = linear_plant([1.0], [0.02, 1.0])
    assert find_operating_point(plant, 50.0, SAMPLING, LIMITS).voltage_V == 50.0


def test_arguments_are_checked(linear_plant: Callable[..., Plant]) -> None:
    plant = linear_plant([1.0], [0.1, 1.0])
    with pytest.raises(ValueError, match="limits must be finite"):
        find_operating_point(plant, 1.0, SAMPLING, UNLIMITED)
    with pytest.raises(ValueError, match="step_V"):
        linearise(plant, OperatingPoint(0.0, 0.0, 20, True), SAMPLING, step_V=0.0)


class WithPlay:
    """A gain behind a play of `width_V`, which rests in its middle where the operating point is sought."""

    def __init__(self, gain: float, width_V: float, rests_in_the_middle: bool) -> None:
        self.gain, self.half_V, self.middle = gain, 0.5 * width_V, rests_in_the_middle
        self.reset()

    def reset(self) -> None:
        self.acting_V, self.first = 0.0, True

    def step(self, voltage_V: float, step_s: float) -> float:
        if self.first and self.middle:
            self.acting_V = voltage_V
        self.first = False
        self.acting_V = min(max(self.acting_V, voltage_V - self.half_V), voltage_V + self.half_V)
        return self.gain * self.acting_V

    def close(self) -> None:
        pass


def test_a_plant_that_rests_in_its_play_is_linearised_by_a_step_that_leaves_it():
    model = linearise_at(WithPlay(0.8, 6.0, rests_in_the_middle=True), 10.0, Sampling(30.0), LIMITS).model
    assert 0.4 <= model.dc_gain_um_per_V <= 0.8


def test_a_plant_without_play_keeps_the_small_step():
    model = linearise_at(WithPlay(0.8, 0.0, rests_in_the_middle=False), 10.0, Sampling(30.0), LIMITS).model
    assert model.dc_gain_um_per_V == pytest.approx(0.8)


PERIOD = 0.02
FREQUENCIES = np.geomspace(0.1, math.pi / PERIOD, 40)


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
    expected = system.freqresp(FREQUENCIES * PERIOD)[1]
    assert model.frequency_response(FREQUENCIES) == pytest.approx(expected, abs=2e-4)
    assert model.dc_gain_um_per_V == pytest.approx(sum(numerator) / sum(denominator), rel=1e-3)


def test_a_relaxation_cut_off_halfway_is_continued() -> None:
    system, step = discrete([0.8, -0.79], [1.0, -0.995, 0.0], 100)
    model = model_from_step(PERIOD, step)
    assert model.tail_ratio == pytest.approx(0.995, rel=1e-9)
    assert model.frequency_response(FREQUENCIES) == pytest.approx(system.freqresp(FREQUENCIES * PERIOD)[1], rel=1e-9)
    longer = discrete([0.8, -0.79], [1.0, -0.995, 0.0], 300)[1]
    assert model.step_response(300) == pytest.approx(longer, rel=1e-9)


def test_an_integrating_plant_is_recognised() -> None:
    system, step = discrete([0.5], [1.0, -1.0], 50)
    model = model_from_step(PERIOD, step)
    assert model.tail_ratio == 1.0
    assert model.dc_gain_um_per_V == math.inf
    assert model.frequency_response(FREQUENCIES) == pytest.approx(system.freqresp(FREQUENCIES * PERIOD)[1], rel=1e-9)


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
    assert model.scaled(factor).frequency_response(FREQUENCIES) == pytest.approx(
        factor * model.frequency_response(FREQUENCIES), rel=1e-12
    )
    assert model.scaled(factor).dc_gain_um_per_V == pytest.approx(factor * model.dc_gain_um_per_V)


def test_a_delay_of_the_step_delays_the_model() -> None:
    step = discrete([0.5], [1.0, -0.9], 200)[1]
    early, late = model_from_step(PERIOD, step), model_from_step(PERIOD, np.append([0.0, 0.0, 0.0], step))
    turned = early.frequency_response(FREQUENCIES) * np.exp(-3j * FREQUENCIES * PERIOD)
    assert late.frequency_response(FREQUENCIES) == pytest.approx(turned, abs=1e-7)


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


PERIOD_S = 0.02
SAMPLES = np.arange(300)
SWINGING = 0.1 * 0.9**SAMPLES * np.cos(0.7 * SAMPLES) + 0.3 * 0.8**SAMPLES
GAINS = Gains(0.4, 5.0, 0.01, 0.05)


@pytest.mark.parametrize(
    ("pulse", "ratio", "latency", "states"),
    [
        (SWINGING, 0.0, 0, 3),
        (SWINGING, 0.0, 2, 5),
        (SWINGING[:30] + 0.01 * 0.99 ** SAMPLES[:30], 0.99, 0, 31),
        (0.2 * 0.8 ** SAMPLES[:60] + 0.1, 1.0, 0, 2),
        (0.3 * 0.5 ** SAMPLES[:20], 0.5, 1, 2),
        (np.concatenate((SWINGING, np.zeros(300))), 0.0, 0, 3),
    ],
    ids=["modes", "late", "slow tail", "integrating", "quick tail", "long"],
)
def test_few_states_give_the_same_step(pulse: np.ndarray, ratio: float, latency: int, states: int):
    model = SampledModel(PERIOD_S, pulse, ratio)
    found = realise(model, latency)
    assert found.error <= TOLERANCE
    assert found.A.shape[0] <= states
    assert np.max(np.abs(np.linalg.eigvals(found.A))) <= 1.0 + 1e-9
    x, readings = np.zeros((found.A.shape[0], 1)), []
    for _ in range(120):
        readings.append(float((found.C @ x)[0, 0]))
        x = found.A @ x + found.B
    wanted = np.concatenate((np.zeros(latency), model.step_response(120)))[:120]
    assert readings == pytest.approx(wanted, abs=2e-3 * float(np.max(np.abs(wanted))))


@pytest.mark.parametrize(
    "gains", [GAINS, Gains(0.4, 0.0, 0.01, 0.05), Gains(0.4, 5.0), Gains(0.0, 5.0), Gains(0.4, 0.0)]
)
def test_the_polynomials_are_the_controller(gains: Gains):
    omega = np.pi / PERIOD_S * np.array([0.01, 0.3, 0.9])
    numerator, denominator = controller_polynomials(gains, PERIOD_S)
    z = np.exp(1j * omega * PERIOD_S)
    assert np.polyval(numerator, z) / np.polyval(denominator, z) == pytest.approx(
        controller_response(gains, PERIOD_S, omega)
    )


def test_without_python_control_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(InputError, match=r"not installed; install it with: python -m pip install control"):
        to_control(GAINS, DelayedPlant(SampledModel(PERIOD_S, SWINGING), 1))


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::PendingDeprecationWarning")
def test_python_control_finds_our_margins():
    control = pytest.importorskip("control", reason="needs the extra control")
    plant = DelayedPlant(SampledModel(PERIOD_S, SWINGING), 1)
    systems = to_control(GAINS, plant)
    ours = margins(GAINS, plant)
    # over frequency: the roots of its polynomials lose a crossing on some processors
    omega = np.geomspace(0.05, 0.999 * np.pi / PERIOD_S, 2000)
    gain_margin, phase_deg, modulus, *_ = control.stability_margins(control.FRD(systems.loop, omega, smooth=True))
    assert gain_margin == pytest.approx(ours.gain_margin, rel=1e-2)
    assert phase_deg == pytest.approx(ours.phase_margin_deg, rel=1e-2)
    assert 1.0 / modulus == pytest.approx(ours.sensitivity_peak, rel=1e-2)
