import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_emulator.terminals import TerminalSettings, step

VOLTS = st.floats(0.0, 80.0)


@given(VOLTS, VOLTS, st.floats(0.0, 1.0), st.booleans(), st.floats(1e-5, 0.1))
def test_the_output_never_passes_its_target(output: float, target: float, limit: float, on: bool, dt: float):
    wanted = target if on else 0.0
    after, current = step(TerminalSettings(), output, target, limit, on, dt)
    assert min(output, wanted) - 1e-9 <= after <= max(output, wanted) + 1e-9
    assert 0.0 <= current <= limit * (1.0 + 1e-9) + 1e-12


@given(st.floats(1e-4, 0.02), st.floats(1.0, 60.0))
def test_a_low_current_limit_makes_a_slow_rise(limit: float, target: float):
    """C dv/dt = I: the rise takes C V / I."""
    settings = TerminalSettings(slew_V_per_s=1e9)
    expected_s = settings.capacitance_F * target / limit
    output, dt = 0.0, expected_s / 200
    for _ in range(199):
        output, _ = step(settings, output, target, limit, True, dt)
    assert output == pytest.approx(target * 199 / 200, rel=1e-9)


@given(VOLTS, st.booleans(), st.integers(1, 50))
def test_the_fall_does_not_depend_on_the_step(output: float, on: bool, parts: int):
    settings = TerminalSettings()
    whole, _ = step(settings, output, 0.0, 0.01, on, 0.05)
    split = output
    for _ in range(parts):
        split, _ = step(settings, split, 0.0, 0.01, on, 0.05 / parts)
    assert split == pytest.approx(whole, rel=1e-9, abs=1e-12)


def test_off_falls_by_the_bleeder():
    settings = TerminalSettings(off_fall_time_s=0.5)
    after, _ = step(settings, 40.0, 40.0, 0.01, False, 0.5)
    assert after == pytest.approx(40.0 / math.e)


@pytest.mark.parametrize("name", ["slew_V_per_s", "capacitance_F", "fall_time_s", "off_fall_time_s"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_settings_out_of_range(name: str, value: float):
    with pytest.raises(ValueError, match=name):
        TerminalSettings(**{name: value})
