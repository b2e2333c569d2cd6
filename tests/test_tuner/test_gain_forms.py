import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from bender_loop.control import pid
from bender_loop.control.pid import UNLIMITED, Gains, PidState
from bender_tuner.rules.gain_forms import IsaForm, from_isa, to_discrete, to_isa

GAIN = st.floats(1e-3, 1e3)
TIME = st.floats(0.0, 1.0)


@given(kp=GAIN, ki=st.one_of(st.just(0.0), GAIN), kd=st.one_of(st.just(0.0), GAIN), tf=TIME, on_error=st.booleans())
def test_isa_and_back(kp: float, ki: float, kd: float, tf: float, on_error: bool) -> None:
    gains = Gains(kp, ki, kd, tf, on_error)
    form = to_isa(gains)
    assert form is not None
    back = from_isa(form, derivative_on_error=on_error)
    assert back.proportional_V_per_um == kp
    assert back.integral_V_per_um_s == pytest.approx(ki)
    assert back.derivative_V_s_per_um == pytest.approx(kd)
    assert (back.filter_time_s, back.derivative_on_error) == (tf, on_error)


def test_isa_by_hand() -> None:
    assert to_isa(Gains(2.0, 8.0, 0.5, 0.1)) == IsaForm(2.0, 0.25, 0.25, 0.1)
    assert to_isa(Gains(2.0, 0.0)) == IsaForm(2.0, math.inf, 0.0, 0.0)


def test_pure_integral_action_has_no_isa_form() -> None:
    assert to_isa(Gains(0.0, 8.0)) is None


@pytest.mark.parametrize("values", [(0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (1.0, 1.0, math.nan, 0.0)])
def test_isa_settings_are_checked(values: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="must be"):
        IsaForm(*values)


@pytest.mark.parametrize("on_error", [False, True])
def test_discrete_form_is_the_block(on_error: bool) -> None:
    gains, period = Gains(0.3, 7.0, 0.02, 0.05, on_error), 1.0 / 30.0
    rng = np.random.default_rng(4)
    # both signals rest at 0 for one sample: the block's first derivative is zero, the filter's has to be too
    setpoint, measurement = (np.append(0.0, rng.normal(size=60)) for _ in range(2))
    form = to_discrete(gains, period)
    from_setpoint = lfilter(form.setpoint_V_per_um, form.denominator, setpoint)
    from_measurement = lfilter(form.measurement_V_per_um, form.denominator, measurement)
    state, commands = PidState(), []
    for r, y in zip(setpoint, measurement, strict=True):
        state, command = pid.step(gains, UNLIMITED, state, float(r), float(y), period)
        commands.append(command)
    assert np.asarray(from_setpoint) - np.asarray(from_measurement) == pytest.approx(np.array(commands), abs=1e-12)


def test_discrete_form_by_hand() -> None:
    form = to_discrete(Gains(1.0, 2.0, 0.5), 0.5)
    assert form.denominator == (1.0, -1.0, 0.0)
    assert form.setpoint_V_per_um == (2.0, -1.0, 0.0)
    assert form.measurement_V_per_um == (3.0, -3.0, 1.0)


def test_period_is_checked() -> None:
    with pytest.raises(ValueError, match="period_s"):
        to_discrete(Gains(1.0, 1.0), 0.0)
