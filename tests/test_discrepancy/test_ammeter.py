"""The supply's current shows a supply at its limit, and nothing else does."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_discrepancy.effects.catalogue import forms
from bender_discrepancy.effects.effect import Sizes
from bender_discrepancy.witnesses.ammeter import slew_range_V_per_s
from bender_discrepancy.witnesses.testimony import judge_channels
from bender_loop.records.record import Record
from bender_proving.cases.witnessed import SITUATIONS, witnessed_case

RATE_HZ, CAPACITANCE_F = 30.0, 1e-6
FORMS = forms(Sizes(50.0, 23.0, 20.0, 104.0, True))


def steps(heights_V: list[float], rows: int = 25) -> np.ndarray:
    levels = np.cumsum([0.0, *heights_V])
    return np.repeat(levels, [5, *[rows] * len(heights_V)])


def charged(volts: np.ndarray, after, noise_A: float, seed: int = 0) -> Record:
    """A record with the current at the middle of each row; `after(age_s, height_V)` is drawn after a step."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(volts.size) / RATE_HZ
    current_A = 2e-6 + noise_A * rng.standard_normal(volts.size)
    for row in np.flatnonzero(np.diff(volts)) + 1:
        ages_s = time_s[row:] - time_s[row] + 0.5 / RATE_HZ
        current_A[row:] += after(ages_s, volts[row] - volts[row - 1])
    return Record(time_s, volts, 0.4 * volts, current_A=current_A)


def limited(rate_V_per_s: float):
    def after(ages_s, height_V):
        return np.sign(height_V) * CAPACITANCE_F * rate_V_per_s * (ages_s < abs(height_V) / rate_V_per_s)

    return after


def lagging(tau_s: float):
    return lambda ages_s, height_V: CAPACITANCE_F * height_V / tau_s * np.exp(-ages_s / tau_s)


@given(st.floats(20.0, 60.0), st.integers(0, 50))
def test_the_rate_is_within_what_the_rows_allow(rate_V_per_s: float, seed: int):
    record = charged(steps([6.0, 8.0, -9.0, 12.0]), limited(rate_V_per_s), 1e-7, seed)
    found = slew_range_V_per_s([record])
    assert found is not None
    assert found[0] <= rate_V_per_s <= found[1]
    assert found[1] / found[0] < 2.0


@given(st.floats(0.003, 3.0), st.floats(1e-9, 1e-6), st.integers(0, 50))
def test_a_lag_is_no_limit(tau_s: float, noise_A: float, seed: int):
    record = charged(steps([6.0, 8.0, -9.0, 12.0], 60), lagging(tau_s), noise_A, seed)
    assert slew_range_V_per_s([record]) is None


def test_noise_alone_and_a_supply_that_is_fast_enough_show_nothing():
    assert slew_range_V_per_s([charged(steps([6.0, 8.0]), lambda ages_s, _: 0.0 * ages_s, 1e-6)]) is None
    assert slew_range_V_per_s([charged(steps([6.0, 8.0]), limited(2000.0), 1e-7)]) is None


def test_a_higher_step_that_does_not_reach_the_limit_contradicts_it():
    volts = steps([6.0, 12.0])
    found = charged(volts, limited(30.0), 1e-7)
    current_A = np.array(found.current_A)
    current_A[30:] = 2e-6
    assert slew_range_V_per_s([found]) is not None
    assert slew_range_V_per_s([Record(found.time_s, volts, found.displacement_um, current_A=current_A)]) is None


def test_records_of_two_limits_show_none():
    slow, fast = (charged(steps([9.0, 12.0]), limited(x), 1e-7) for x in (20.0, 60.0))
    assert slew_range_V_per_s([slow]) is not None
    assert slew_range_V_per_s([slow, fast]) is None


def test_what_the_read_back_voltage_excludes_is_not_shown_by_the_current():
    record = charged(steps([6.0, 8.0, -9.0, 12.0]), limited(30.0), 1e-7)
    told = judge_channels([record], FORMS, is_film=True)
    assert "slew_limit" in told.shown
    assert any("current stays at its limit" in x for x in told.sentences)
    faithful = Record(
        record.time_s,
        record.voltage_V,
        record.displacement_um,
        supply_voltage_V=record.voltage_V + 0.002 * np.random.default_rng(1).standard_normal(len(record)),
        current_A=record.current_A,
    )
    told = judge_channels([faithful], FORMS, is_film=True)
    assert "slew_limit" not in told.shown


@pytest.mark.parametrize("turn", range(6))
def test_benches_at_their_limit_show_it_whatever_their_landing(turn: int):
    (number,) = (k for k, x in enumerate(SITUATIONS) if x.shown_by == "ammeter")
    case = witnessed_case(number + turn * len(SITUATIONS), 78)
    found = slew_range_V_per_s([case.record])
    assert found is not None
    assert found[0] / 1.2 <= case.hidden.magnitude <= found[1] * 1.2
