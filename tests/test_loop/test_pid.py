"""The PID block: laws that hold for any gains, and numbers worked out by hand. In a loop: `test_closed_loop.py`."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.control import pid
from bender_loop.control.pid import UNLIMITED, Gains, Limits, PidState

gain = st.floats(0.0, 100.0)
signal = st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=20)
period = st.floats(1e-4, 1.0)
gains_of_any_kind = st.builds(Gains, gain, gain, gain, st.floats(0.0, 1.0), st.booleans())


def run(gains, limits, setpoints, measurements, dt_s):
    state, commands = PidState(), []
    for setpoint, measurement in zip(setpoints, measurements, strict=True):
        state, command = pid.step(gains, limits, state, setpoint, measurement, dt_s)
        commands.append(command)
    return np.array(commands), state


@given(gains=gains_of_any_kind, measured=signal, dt_s=period, scale=st.floats(-20.0, 20.0))
def test_without_limits_the_block_is_linear(gains, measured, dt_s, scale):
    setpoints = np.linspace(0.0, 10.0, len(measured))
    commands, _ = run(gains, UNLIMITED, setpoints, measured, dt_s)
    scaled, _ = run(gains, UNLIMITED, scale * setpoints, [scale * value for value in measured], dt_s)
    tolerance = 1e-10 * (1.0 + np.abs(commands).max()) * (1.0 + abs(scale))
    np.testing.assert_allclose(scaled, scale * commands, atol=tolerance)


@given(gains=gains_of_any_kind, measured=signal, dt_s=period, tracking=st.floats(0.0, 1.0))
def test_the_command_never_leaves_its_limits(gains, measured, dt_s, tracking):
    commands, state = run(gains, Limits(-3.0, 7.0, tracking), [10.0] * len(measured), measured, dt_s)
    assert commands.min() >= -3.0
    assert commands.max() <= 7.0
    assert all(map(math.isfinite, state))


def test_paper_mode_is_equation_21_by_hand():
    # u = Kp e + Ki sum(e) dt + Kd de/dt with e = 10, 8, 5 and dt = 0.1; the first difference quotient is nothing.
    gains = Gains(2.0, 3.0, 0.5, filter_time_s=0.0, derivative_on_error=True)
    commands, _ = run(gains, UNLIMITED, [10.0] * 3, [0.0, 2.0, 5.0], 0.1)
    by_hand = [2 * 10 + 3 * 1.0, 2 * 8 + 3 * 1.8 + 0.5 * -20, 2 * 5 + 3 * 2.3 + 0.5 * -30]
    assert commands == pytest.approx(by_hand, rel=1e-14)


@pytest.mark.parametrize("on_error", [False, True])
def test_a_jump_of_the_setpoint_kicks_only_in_paper_mode_and_the_first_measurement_never(on_error):
    gains = Gains(0.0, 0.0, 1.0, derivative_on_error=on_error)
    commands, _ = run(gains, UNLIMITED, [0.0, 0.0, 10.0], [5.0, 5.0, 5.0], 0.1)
    assert commands.tolist() == [0.0, 0.0, pytest.approx(100.0 if on_error else 0.0)]


@pytest.mark.parametrize("tracking_time_s", [0.0, 0.05])
def test_back_calculation_lets_go_at_once(tracking_time_s):
    dt_s, gains = 0.01, Gains(0.1, 10.0)
    limits = Limits(0.0, 50.0, tracking_time_s)
    _, state = run(gains, limits, [100.0] * 500, [0.0] * 500, dt_s)
    _, wound_up = run(gains, UNLIMITED, [100.0] * 500, [0.0] * 500, dt_s)
    assert wound_up.integral_V > 4000.0
    # The integral rests where it is led back as fast as it grows, Ki e Tt above the bound at most.
    assert state.integral_V + 0.1 * 100.0 == pytest.approx(50.0 + 10.0 * 100.0 * tracking_time_s, rel=1e-6)
    command = 50.0
    ticks = 0
    while command >= 50.0:
        state, command = pid.step(gains, limits, state, 100.0, 150.0, dt_s)
        ticks += 1
    assert ticks <= 1 + 3.0 * tracking_time_s / dt_s


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Gains(math.nan, 1.0), "proportional_V_per_um must be a finite number >= 0, found nan"),
        (lambda: Gains(1.0, -1.0), "integral_V_per_um_s must be a finite number >= 0, found -1.0"),
        (lambda: Limits(5.0, 5.0), "lower_V must lie below upper_V, found 5.0 and 5.0"),
        (lambda: Limits(0.0, 5.0, -1.0), "tracking_time_s must be a finite number >= 0, found -1.0"),
    ],
)
def test_bad_settings(make, message):
    with pytest.raises(ValueError, match=message):
        make()
