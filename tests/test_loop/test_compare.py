import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from bender_loop.errors import InputError
from bender_loop.records.compare import agreement, compare, recalibrate

READINGS = hnp.arrays(np.float64, st.integers(5, 40), elements=st.floats(-50, 50, width=32))


def test_hand_numbers():
    measured, simulated = np.array([0.0, 2.0, 4.0]), np.array([1.0, 2.0, 3.0])
    result = compare(measured, simulated)
    assert result.before.rms_um == pytest.approx(math.sqrt(2 / 3))
    assert result.before.nrmse_percent == pytest.approx(100 * math.sqrt(2 / 3) / 4)
    assert result.before.fit_percent == pytest.approx(100 * (1 - math.sqrt(2) / math.sqrt(8)))
    assert (result.recalibration.gain, result.recalibration.offset_um) == pytest.approx((2.0, -2.0))
    assert result.recalibrated.rms_um == pytest.approx(0.0, abs=1e-12)
    assert result.recalibrated.fit_percent == pytest.approx(100.0)


def test_recalibration_agrees_with_polyfit():
    rng = np.random.default_rng(3)
    simulated = rng.normal(size=200)
    measured = 0.4 * simulated - 7.0 + 0.1 * rng.normal(size=200)
    line = recalibrate(measured, simulated)
    assert (line.gain, line.offset_um) == pytest.approx(tuple(np.polyfit(simulated, measured, 1)))


@given(READINGS, st.floats(-1e3, 1e3), st.floats(0.01, 100))
def test_gain_and_offset_of_the_simulation_leave_the_recalibrated_gap_alone(simulated, offset_um, gain):
    rows = np.arange(simulated.size)
    measured = 0.8 * simulated + np.sin(rows)
    # A gain can only be undone where rounding leaves enough of the signal.
    if np.ptp(simulated) < 0.1:
        return
    plain = compare(measured, simulated).recalibrated.rms_um
    bent = compare(measured, gain * simulated + offset_um).recalibrated.rms_um
    assert bent == pytest.approx(plain, rel=1e-6, abs=1e-6)


@given(READINGS, READINGS)
def test_recalibration_never_widens_the_gap(measured, simulated):
    size = min(measured.size, simulated.size)
    result = compare(measured[:size], simulated[:size])
    assert result.recalibrated.rms_um <= result.before.rms_um * (1 + 1e-9) + 1e-9


@given(st.permutations(range(12)))
def test_figures_do_not_depend_on_the_order_of_the_rows(order):
    rng = np.random.default_rng(1)
    measured, simulated = rng.normal(size=12), rng.normal(size=12)
    shuffled = compare(measured[list(order)], simulated[list(order)])
    assert shuffled.recalibrated.rms_um == pytest.approx(compare(measured, simulated).recalibrated.rms_um)


def test_lost_frames_are_left_out():
    measured, simulated = np.array([0.0, np.nan, 2.0, 4.1]), np.array([0.1, 1e9, 2.0, 4.0])
    result = compare(measured, simulated)
    seen = [0, 2, 3]
    assert (result.rows, result.lost_rows) == (4, 1)
    assert result.before == agreement(measured[seen], simulated[seen])


def test_constant_signals_leave_undefined_figures_undefined():
    flat = np.full(5, 3.0)
    result = compare(flat, np.arange(5.0))
    assert result.before.nrmse_percent is None
    assert result.before.fit_percent is None
    assert result.recalibrated.rms_um == pytest.approx(0.0, abs=1e-12)
    still = compare(np.arange(5.0), flat)
    assert (still.recalibration.gain, still.recalibration.offset_um) == (1.0, -1.0)


def test_too_few_readings_are_refused():
    with pytest.raises(InputError, match="2 readings in 4 rows"):
        compare(np.array([1.0, np.nan, 2.0, np.nan]), np.arange(4.0))


def test_shapes_must_agree():
    with pytest.raises(ValueError, match="shapes differ"):
        compare(np.arange(4.0), np.arange(5.0))
