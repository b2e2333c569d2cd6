"""The closed loop against transfer functions by scipy, and the laws of its camera and its supply."""

import math

import numpy as np
import pytest
import scipy.signal
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.control.closed_loop import Sampling, limits_at, simulate
from bender_loop.control.pid import UNLIMITED, Gains, Limits
from bender_loop.control.references import Sine, Step

GAINS = Gains(0.6, 9.0, 0.02, filter_time_s=0.03)
RAMP = Sine(4.0, 1.3, 6.0, 0.4)
COLUMNS = ("time_s", "setpoint_um", "measured_um", "displacement_um", "voltage_V")


def closed_loop_oracle(gains, period_s, latency, setpoints):
    """y / r of the lag (0.5 um/V, 0.1 s) under the PID block, as one transfer function of z, filtered by scipy."""
    pole = math.exp(-period_s / 0.1)
    plant_num, plant_den = np.array([0.5 * (1.0 - pole)]), np.array([1.0, -pole])
    tf_s = gains.filter_time_s
    kp, ki = gains.proportional_V_per_um, gains.integral_V_per_um_s
    pi_num = np.array([kp + ki * period_s, -kp])
    pi_den = np.array([1.0, -1.0])
    d_num = gains.derivative_V_s_per_um * np.array([1.0, -1.0])
    d_den = np.array([tf_s + period_s, -tf_s])
    late = np.concatenate([[1.0], np.zeros(latency)])
    controller = np.polyadd(np.polymul(pi_num, d_den), np.polymul(d_num, pi_den))
    open_den = np.polymul(np.polymul(np.polymul(pi_den, d_den), plant_den), late)
    den = np.polyadd(open_den, np.polymul(controller, plant_num))
    num = np.polymul(np.polymul(np.polymul(pi_num, d_den), plant_num), late)
    num = np.concatenate([np.zeros(len(den) - len(num)), num])
    return scipy.signal.lfilter(num, den, setpoints)


@pytest.mark.parametrize("latency", [0, 1, 5])
@pytest.mark.parametrize("gains", [GAINS, Gains(0.0, 5.0), Gains(1.0, 0.0, 0.05)])
def test_linear_loop_is_that_of_scipy(lag, gains, latency):
    trace = simulate(lag(), gains, UNLIMITED, RAMP, Sampling(50.0, latency), 3.0)
    expected = closed_loop_oracle(gains, 0.02, latency, trace.setpoint_um)
    np.testing.assert_allclose(trace.displacement_um, expected, rtol=1e-9, atol=1e-10)


def test_the_frame_is_read_before_the_command_acts(lag):
    # A plant without memory shows each command in the next frame only.
    plant = lag(gain_um_per_V=0.5, feedthrough=1.0)
    trace = simulate(plant, Gains(1.0, 0.0), UNLIMITED, Step(10.0), Sampling(10.0), 0.3)
    assert trace.displacement_um.tolist() == [0.0, 5.0, 2.5, 3.75]
    assert trace.voltage_V.tolist() == [10.0, 5.0, 7.5, 6.25]
    record = trace.to_record()
    np.testing.assert_array_equal(record.displacement_um, trace.measured_um)
    np.testing.assert_array_equal(record.voltage_V, trace.voltage_V)


def test_latency_hands_out_older_frames_and_before_them_what_the_plant_reads_at_rest(lag):
    trace = simulate(lag(rest_um=3.0), GAINS, Limits(), RAMP, Sampling(50.0, 3), 1.0)
    np.testing.assert_array_equal(trace.measured_um, [3.0, 3.0, 3.0, *trace.displacement_um[:-3]])
    assert trace.displacement_um[0] == 3.0


@pytest.mark.parametrize("substeps", [1, 4])
def test_more_plant_steps_do_not_change_the_frames(lag, substeps):
    plain = simulate(lag(), GAINS, Limits(0.0, 12.0), RAMP, Sampling(50.0), 1.0)
    # An endless slew bound of 1e12 V/s takes the general way through the loop without acting.
    fine = simulate(lag(), GAINS, Limits(0.0, 12.0), RAMP, Sampling(50.0, substeps=substeps), 1.0, slew_V_per_s=1e12)
    for name in COLUMNS:
        np.testing.assert_allclose(getattr(fine, name), getattr(plain, name), rtol=1e-11, atol=1e-11)


def test_the_fine_trace_holds_the_time_between_the_frames(lag):
    trace = simulate(lag(), GAINS, Limits(), Step(10.0), Sampling(50.0, substeps=4), 0.1)
    assert trace.fine_time_s is not None
    assert trace.fine_displacement_um is not None
    np.testing.assert_allclose(trace.fine_time_s, np.arange(21) * 0.005, rtol=1e-15)
    np.testing.assert_array_equal(trace.fine_displacement_um[::4], trace.displacement_um)
    plant = lag()
    expected = [plant.step(trace.voltage_V[k // 4], 0.005) for k in range(20)]
    np.testing.assert_array_equal(trace.fine_displacement_um[1:], expected)


@pytest.mark.parametrize("exposure_s", [0.02, 0.0137, 0.004])
def test_exposure_is_the_mean_over_the_window_that_ends_with_the_frame(lag, exposure_s):
    def gap(substeps):
        sampling = Sampling(50.0, exposure_s=exposure_s, substeps=substeps)
        trace = simulate(lag(), Gains(1.0, 0.0), UNLIMITED, Step(10.0), sampling, 0.4)
        goal = 0.5 * trace.voltage_V[:-1]
        # y = goal + (y0 - goal) exp(-t / tau), averaged in closed form over the window.
        mean = math.exp(-0.02 / 0.1) * 0.1 / exposure_s * math.expm1(exposure_s / 0.1)
        expected = goal + (trace.displacement_um[:-1] - goal) * mean
        return np.abs(trace.measured_um[1:] - expected).max()

    assert gap(200) < 2e-3
    assert gap(200) < 0.2 * gap(20)


@given(part=st.floats(0.05, 1.0), more=st.integers(0, 30))
def test_exposure_weights_are_a_mean_over_the_window(part, more):
    substeps = math.ceil(2.0 / part) + more
    sampling = Sampling(10.0, exposure_s=0.1 * part, substeps=substeps)
    weights = sampling.exposure_weights()
    assert weights.sum() == pytest.approx(1.0)
    assert weights.min() >= 0.0
    # The mean of a straight line lies in the middle of the window; a full window takes its first step as constant.
    ends = (np.arange(substeps) + 1.0) / substeps
    into_first = max(0.0, part * substeps - (substeps - 1.0))
    shift = 0.5 * (into_first / substeps) ** 2 / part
    assert weights @ ends == pytest.approx(1.0 - 0.5 * part + shift, abs=1e-9)


def test_noise_comes_from_the_generator_and_reaches_the_controller_only(lag):
    sampling = Sampling(50.0, noise_um=0.3)
    first, second, other = (
        simulate(lag(), GAINS, Limits(), Step(10.0), sampling, 40.0, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first.measured_um, second.measured_um)
    assert np.any(first.measured_um != other.measured_um)
    noise = first.measured_um - first.displacement_um
    assert noise.std() == pytest.approx(0.3, rel=0.1)
    assert abs(noise.mean()) < 0.05


def test_frames_are_rounded_to_the_quantum(lag):
    trace = simulate(lag(), GAINS, Limits(), RAMP, Sampling(50.0, quantum_um=0.7), 2.0)
    steps = trace.measured_um / 0.7
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.abs(trace.measured_um - trace.displacement_um).max() <= 0.35 + 1e-9
    assert len(np.unique(trace.measured_um)) > 5


@given(limit=st.floats(0.5, 30.0), slew=st.floats(1.0, 500.0), lower=st.sampled_from([-5.0, 0.0, 2.0]))
def test_commands_keep_limits_and_slew(lag, limit, slew, lower):
    limits = Limits(lower, lower + limit)
    trace = simulate(lag(), Gains(5.0, 40.0, 0.1), limits, Sine(20.0, 1.0), Sampling(50.0), 1.0, slew_V_per_s=slew)
    assert trace.voltage_V.min() >= limits.lower_V
    assert trace.voltage_V.max() <= limits.upper_V
    start = min(max(0.0, limits.lower_V), limits.upper_V)
    assert np.abs(np.diff(trace.voltage_V, prepend=start)).max() <= slew * 0.02 * (1.0 + 1e-9)


def test_a_slew_bound_does_not_wind_up_the_integral(lag):
    # Long on the bound, then at the setpoint: the overshoot stays small as it would not with a wound-up integral.
    trace = simulate(lag(), Gains(0.2, 8.0), Limits(), Step(10.0), Sampling(50.0), 6.0, slew_V_per_s=10.0)
    assert trace.displacement_um.max() < 10.6
    assert trace.displacement_um[-1] == pytest.approx(10.0, abs=1e-3)


def test_limits_at_one_tick():
    assert limits_at(Limits(0.0, 50.0, 0.1), 10.0, 3.0, 4.0) == Limits(3.0, 9.0, 0.1)
    assert limits_at(Limits(0.0, 50.0), 1.0, 3.0) == Limits(0.0, 4.0)
    assert limits_at(Limits(0.0, 50.0), 49.0, math.inf) == Limits(0.0, 50.0)


class Exploding:
    """Sound for three steps, then `value`."""

    def __init__(self, value: float):
        self.value, self.count = value, 0

    def reset(self) -> None:
        self.count = 0

    def step(self, voltage_V: float, step_s: float) -> float:
        self.count += 1
        return 1.0 if self.count <= 3 else self.value

    def close(self) -> None:
        pass


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e15])
@pytest.mark.parametrize("sampling", [Sampling(10.0), Sampling(10.0, 1, noise_um=0.1, quantum_um=0.1)])
def test_a_runaway_ends_the_run(value, sampling):
    plant = Exploding(value)
    trace = simulate(plant, GAINS, Limits(), Step(10.0), sampling, 100.0, np.random.default_rng(0))
    assert trace.diverged
    assert plant.count == 4
    assert [len(getattr(trace, name)) for name in COLUMNS] == [4] * 5
    assert all(np.isfinite(getattr(trace, name)).all() for name in COLUMNS)


def test_a_run_forgets_the_one_before(lag):
    plant = lag()
    runs = [simulate(plant, GAINS, Limits(), RAMP, Sampling(50.0, 1), 1.0) for _ in range(2)]
    np.testing.assert_array_equal(runs[0].displacement_um, runs[1].displacement_um)


@pytest.mark.parametrize(("duration_s", "rows"), [(2.0, 201), (0.29, 30), (0.019999, 2), (0.01, 2)])
def test_whole_periods_are_run(lag, duration_s, rows):
    trace = simulate(lag(), GAINS, Limits(), RAMP, Sampling(100.0), duration_s)
    assert [len(getattr(trace, name)) for name in COLUMNS] == [rows] * 5
    np.testing.assert_array_equal(trace.time_s, np.arange(rows) * 0.01)
    assert not trace.diverged
    assert trace.fine_time_s is None


def run_with(duration_s=1.0, noise_um=0.0, **more):
    sampling = Sampling(10.0, noise_um=noise_um)
    return lambda lag: simulate(lag(), GAINS, Limits(), Step(10.0), sampling, duration_s, **more)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda _: Sampling(0.0), "rate_Hz must be a finite number > 0, found 0.0"),
        (lambda _: Sampling(10.0, -1), "latency_frames must be a whole number >= 0, found -1"),
        (lambda _: Sampling(10.0, 0.5), "latency_frames must be a whole number"),  # type: ignore[arg-type]
        (lambda _: Sampling(10.0, substeps=0), "substeps must be a whole number >= 1, found 0"),
        (lambda _: Sampling(10.0, noise_um=-1.0), "noise_um must be a finite number >= 0"),
        (lambda _: Sampling(10.0, exposure_s=0.2, substeps=10), "exposure_s must be at most the period 0.1 s, found"),
        (lambda _: Sampling(10.0, exposure_s=0.03, substeps=5), "substeps must be at least 7 for exposure_s 0.03"),
        *((run_with(x), r"duration_s must be at least the period 0.1 s") for x in (0.0, 0.05, math.nan, math.inf)),
        (run_with(slew_V_per_s=0.0), r"slew_V_per_s must be > 0, found 0.0"),
        (run_with(noise_um=0.1), "noise_um > 0 needs rng"),
    ],
)
def test_impossible_samplings_and_runs_are_refused(lag, make, message):
    with pytest.raises(ValueError, match=message):
        make(lag)
