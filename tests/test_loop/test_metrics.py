"""References in closed form, and figures of a step response by hand and against the second-order formulas."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.control.metrics import has_settled, step_metrics
from bender_loop.control.references import (
    Profile,
    Sine,
    Step,
    read_profile,
)
from bender_loop.control.trace import Trace
from bender_loop.errors import InputError


def trace_of(time_s, displacement_um, setpoint_um, voltage_V=None, **more):
    time_s = np.asarray(time_s, dtype=float)
    displacement = np.asarray(displacement_um, dtype=float)
    voltage = np.zeros_like(time_s) if voltage_V is None else np.asarray(voltage_V, dtype=float)
    return Trace(time_s, np.full_like(time_s, setpoint_um), displacement, displacement, voltage, **more)


def ringing(zeta=0.3, omega=10.0, setpoint=10.0, end_s=6.0, step_s=1e-3):
    time_s = np.arange(round(end_s / step_s) + 1) * step_s
    damped = omega * math.sqrt(1.0 - zeta**2)
    phase = math.acos(zeta)
    response = 1.0 - np.exp(-zeta * omega * time_s) * np.sin(damped * time_s + phase) / math.sin(phase)
    return trace_of(time_s, setpoint * response, setpoint)


def test_by_hand():
    trace = trace_of([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 5.0, 12.0, 10.1, 9.9], 10.0, [8.0, 20.0, 15.0, 19.0, 20.0])
    figures = step_metrics(trace)
    assert figures.mse_um2 == pytest.approx((100 + 25 + 4 + 0.01 + 0.01) / 5)
    assert figures.itae_um_s2 == pytest.approx(5.0 + 4.0 + 0.3 + 0.5 * 0.4)
    assert figures.overshoot_percent == pytest.approx(20.0)
    assert figures.rise_time_s == pytest.approx((1.0 + 4.0 / 7.0) - 0.2)
    assert figures.settling_time_s == 3.0
    assert figures.steady_state_error_um == pytest.approx(0.1)
    assert figures.total_variation_V == pytest.approx(8 + 12 + 5 + 4 + 1)
    assert figures.peak_V == 20.0


@given(st.floats(1e-3, 1e3), st.floats(-1.0, 1.0))
def test_a_response_that_enters_the_band_in_the_last_twentieth_of_a_run_has_not_settled(run_s: float, later: float):
    end_s = (1.0 - 0.05) * run_s
    assert has_settled(end_s, run_s)
    assert has_settled(end_s + 0.05 * later * run_s, run_s) is (later <= 0.0 or end_s + 0.05 * later * run_s == end_s)


def test_the_second_order_system():
    zeta, omega = 0.3, 10.0
    figures = step_metrics(ringing(zeta, omega))
    overshoot = math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2))
    assert figures.overshoot_percent == pytest.approx(100.0 * overshoot, rel=1e-4)
    # The last crossing of the 2 % band lies below the envelope's, by less than half a period.
    envelope = -math.log(0.02 * math.sqrt(1 - zeta**2)) / (zeta * omega)
    assert envelope - math.pi / omega < figures.settling_time_s <= envelope
    assert figures.steady_state_error_um == pytest.approx(0.0, abs=1e-5)


def test_the_first_order_lag():
    time_s = np.arange(5001) * 1e-3
    figures = step_metrics(trace_of(time_s, 4.0 * -np.expm1(-time_s / 0.5), 4.0))
    assert figures.rise_time_s == pytest.approx(0.5 * math.log(9.0), rel=1e-5)
    assert figures.settling_time_s == pytest.approx(0.5 * math.log(50.0), abs=1.1e-3)
    assert figures.overshoot_percent == 0.0
    assert figures.mse_um2 == pytest.approx(16.0 * 0.25 / 5.0, rel=3e-3)
    assert figures.itae_um_s2 == pytest.approx(4.0 * 0.25, rel=2e-3)


def in_order(figures):
    return np.array(dataclasses.astuple(figures))


@given(scale=st.floats(0.01, 100.0), sign=st.sampled_from([-1.0, 1.0]))
def test_scale(scale, sign):
    plain, factor = ringing(end_s=3.0, step_s=0.01), sign * scale
    scaled = trace_of(plain.time_s, factor * plain.displacement_um, factor * 10.0, factor * np.ones(len(plain.time_s)))
    factors = np.array([scale**2, scale, 1.0, 1.0, 1.0, factor, scale, scale])
    one = trace_of(plain.time_s, plain.displacement_um, 10.0, np.ones(len(plain.time_s)))
    np.testing.assert_allclose(in_order(step_metrics(scaled)), factors * in_order(step_metrics(one)), rtol=1e-9)


@given(rest=st.floats(-50.0, 50.0), shift=st.integers(-1000, 1000))
def test_offset_and_shift_in_time(rest, shift):
    plain = ringing(end_s=3.0, step_s=0.01)
    moved = trace_of(plain.time_s + 0.01 * shift, plain.displacement_um + rest, 10.0 + rest)
    np.testing.assert_allclose(in_order(step_metrics(moved)), in_order(step_metrics(plain)), rtol=1e-7, atol=1e-9)


@given(rows=st.integers(1, 200))
def test_what_lies_before_the_step_is_left_out(rows):
    plain = ringing(end_s=3.0, step_s=0.01)
    time_s = np.concatenate([np.arange(-rows, 0) * 0.01, plain.time_s])
    waited = trace_of(time_s, np.concatenate([np.zeros(rows), plain.displacement_um]), 10.0)
    figures = step_metrics(waited, start_s=0.0)
    np.testing.assert_allclose(in_order(figures), in_order(step_metrics(plain)), rtol=1e-9, atol=1e-9)


def test_what_is_never_reached_or_left_again_is_not_a_number():
    time_s = np.arange(100) * 0.01
    low = step_metrics(trace_of(time_s, 5.0 * -np.expm1(-time_s / 0.1), 10.0))
    assert math.isnan(low.rise_time_s)
    assert math.isnan(low.settling_time_s)
    assert low.steady_state_error_um == pytest.approx(5.0, abs=0.01)
    left = np.array([0.0, *[10.0] * 98, 11.0])
    assert math.isnan(step_metrics(trace_of(time_s, left, 10.0)).settling_time_s)


def test_a_diverged_run_is_worse_than_any_other():
    figures = step_metrics(trace_of([0.0, 1.0], [0.0, 99.0], 10.0, [5.0, -7.0], diverged=True))
    assert figures.mse_um2 == figures.itae_um_s2 == figures.overshoot_percent == math.inf
    assert math.isnan(figures.settling_time_s)
    assert (figures.total_variation_V, figures.peak_V) == (17.0, 7.0)


def test_between_the_frames():
    fine_time = np.arange(9) * 0.25
    fine = np.array([0.0, 14.0, 6.0, 13.0, 8.0, 12.0, 9.0, 11.0, 10.0])
    trace = trace_of(fine_time[::4], fine[::4], 10.0, fine_time_s=fine_time, fine_displacement_um=fine)
    assert step_metrics(trace).overshoot_percent == 0.0
    assert step_metrics(trace, intersample=True).overshoot_percent == pytest.approx(40.0)


EVERY = [
    Step(10.0, 0.5, 2.0),
    Sine(4.0, 1.5, 6.0, 0.3),
    Profile((0.0, 0.7, 1.1), (1.0, 2.0, 3.0)),
]


@pytest.mark.parametrize("reference", EVERY, ids=lambda reference: type(reference).__name__)
@given(times=st.lists(st.floats(-1.0, 5.0), min_size=1, max_size=20))
def test_value_is_sample(reference, times):
    sampled = reference.sample(times)
    assert sampled.shape == (len(times),)
    assert [reference.value(time_s) for time_s in times] == pytest.approx(sampled.tolist(), abs=1e-12)


@pytest.mark.parametrize(
    ("reference", "times", "values"),
    [
        (Step(10.0, 0.3, 1.0), (0.0, 0.29, 0.1 + 0.2, 9.0), (1.0, 1.0, 10.0, 10.0)),
        (Profile((0.0, 0.5, 2.0), (1.0, 2.0, 3.0)), (-1.0, 0.0, 0.49, 0.5, 1.99, 2.0, 99.0), (1, 1, 1, 2, 2, 3, 3)),
        (Sine(2.0, 0.25, 5.0, math.pi / 2), (0.0, 1.0, 2.0), (7.0, 5.0, 3.0)),
        (Sine(2.0, 0.25), (1.0,), (2.0,)),
    ],
)
def test_references_by_hand_and_where_rounding_puts_their_times(reference, times, values):
    assert [reference.value(t) for t in times] == pytest.approx(values, abs=1e-12)


def test_profile_from_a_file(tmp_path):
    path = tmp_path / "profile.csv"
    path.write_text("time_s,setpoint_um,remark\n0,0,start\n1.5,10,up\n")
    assert read_profile(path) == Profile((0.0, 1.5), (0.0, 10.0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,setpoint_um\n", "must be of one length > 0"),
        ("time_s,level\n0,0\n", "line 1, column setpoint_um: no such column"),
        ("time_s,setpoint_um\n0,nan\n", "line 2, column setpoint_um: found nan, expected a finite number"),
        ("time_s,setpoint_um\n0,\n", "line 2, column setpoint_um: found '', expected a number"),
        ("time_s,setpoint_um\n0,0\n0,1\n", "line 3, column time_s: found 0.0, expected more than 0.0"),
    ],
)
def test_bad_profiles(tmp_path, text, message):
    path = tmp_path / "profile.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_profile(path)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Step(math.nan), "level_um must be finite, found nan"),
        (lambda: Sine(1.0, -1.0), "frequency_Hz must be > 0, found -1.0"),
        (lambda: Profile((0.0, 0.0), (1.0, 2.0)), "times_s must increase strictly"),
        (lambda: Profile((), ()), "must be of one length > 0"),
        (lambda: metrics_to(0.0), "setpoint_um must differ from the displacement at the step, found 0.0"),
        (lambda: metrics_to(10.0, start_s=1.0), "start_s must leave at least 2 samples"),
        (lambda: metrics_to(10.0, intersample=True), "intersample needs a trace with more than one plant step"),
    ],
)
def test_impossible_references_and_requests_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def metrics_to(setpoint_um, **more):
    return step_metrics(trace_of([0.0, 1.0], [0.0, 9.0], setpoint_um), **more)
