"""A plant driven by a record: the convention of the rows, ramps, late commands, uneven steps."""

import math

import numpy as np
import pytest
import scipy.integrate
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.records.drive import drive, drive_record, even_steps
from bender_loop.records.record import Record

UNEVEN_S = np.array([0.0, 0.05, 0.3, 0.32, 0.7, 1.0])
VOLTAGE = np.array([4.0, 1.0, 7.0, 0.0, -3.0, 5.0])
LATE_S = UNEVEN_S + np.array([0.01, 0.0, 0.02, 0.1, 0.3, 0.2])


def oracle(lag, time_s, voltage_at, corners):
    """The lag by an ODE solver, restarted at every corner of the input."""
    plant, state, readings = lag(), 0.0, []

    def rate(t, y):
        return (plant.gain * voltage_at(t) - y) / plant.tau_s

    times = np.unique(np.concatenate([time_s, corners]))
    for start, end in zip(times, [*times[1:], times[-1]], strict=True):
        if start in time_s:
            readings.append(state)
        if end > start:
            inside = (start + 1e-13, end - 1e-13)
            state = scipy.integrate.solve_ivp(rate, inside, [state], rtol=1e-11, atol=1e-12).y[0, -1]
    return np.array(readings)


def held(acting_s):
    return lambda t: 0.0 if t < acting_s[0] else VOLTAGE[np.searchsorted(acting_s, t, side="right") - 1]


def ramped(acting_s):
    return lambda t: 0.0 if t < acting_s[0] else np.interp(t, acting_s, VOLTAGE)


@pytest.mark.parametrize("acting_s", [None, LATE_S])
def test_held_commands(lag, acting_s):
    used = UNEVEN_S if acting_s is None else acting_s
    readings = drive(lag(), UNEVEN_S, VOLTAGE, command_time_s=acting_s)
    np.testing.assert_allclose(readings, oracle(lag, UNEVEN_S, held(used), used[:-1]), atol=1e-8)


@pytest.mark.parametrize("acting_s", [None, LATE_S])
def test_ramps_converge_with_the_square_of_the_step(lag, acting_s):
    used = UNEVEN_S if acting_s is None else acting_s
    expected = oracle(lag, UNEVEN_S, ramped(used), used[:-1])

    def gap(ramp_steps):
        readings = drive(lag(), UNEVEN_S, VOLTAGE, command_time_s=acting_s, input_hold="linear", ramp_steps=ramp_steps)
        return np.abs(readings - expected).max()

    assert gap(64) < 3e-4
    assert gap(16) / gap(32) == pytest.approx(4.0, rel=0.1)


def test_a_row_is_read_before_its_voltage_acts(lag):
    plant = lag(gain_um_per_V=2.0, feedthrough=1.0)
    assert drive(plant, [0.0, 1.0, 3.0], [5.0, 7.0, 9.0]).tolist() == [0.0, 10.0, 14.0]
    assert plant.steps == [(5.0, 1.0), (7.0, 2.0)]


def test_a_ramp_has_arrived_when_the_row_is_read(lag):
    plant = lag(gain_um_per_V=2.0, feedthrough=1.0)
    readings = drive(plant, [0.0, 1.0, 3.0], [5.0, 7.0, 9.0], input_hold="linear")
    assert readings.tolist() == [0.0, 14.0, 18.0]
    assert sum(step_s for _, step_s in plant.steps) == pytest.approx(3.0)


def test_a_row_may_cut_a_late_ramp(lag):
    # The ramp from 4 V to 8 V runs from 0.5 s to 2.5 s: row 1 is read at a quarter of it, row 2 at three quarters.
    plant = lag(gain_um_per_V=1.0, feedthrough=1.0)
    readings = drive(plant, [0.0, 1.0, 2.0], [4.0, 8.0, 0.0], command_time_s=[0.5, 2.0, 2.0], input_hold="linear")
    assert readings == pytest.approx([0.0, 4.0 + 4.0 * 0.5 / 1.5, 8.0])


def test_commands_that_act_with_the_next_row_are_one_row_late(lag):
    time_s = np.arange(4.0)
    late = drive(lag(), time_s, [1.0, 2.0, 3.0, 4.0], command_time_s=[1.0, 2.0, 3.0, 4.0])
    np.testing.assert_allclose(late, drive(lag(), time_s, [0.0, 1.0, 2.0, 3.0]), rtol=1e-12)


def test_the_first_row_is_what_the_plant_reads_at_rest(lag):
    assert drive(lag(rest_um=2.5), [3.0, 4.0], [0.0, 0.0]).tolist() == [2.5, 2.5]


@given(shift=st.floats(-100.0, 100.0))
def test_the_clock_starts_with_the_first_row(lag, shift):
    np.testing.assert_allclose(
        drive(lag(), UNEVEN_S + shift, VOLTAGE), drive(lag(), UNEVEN_S, VOLTAGE), rtol=1e-9, atol=1e-9
    )


@given(voltage=st.lists(st.floats(-50.0, 50.0), min_size=2, max_size=10), row=st.integers(0, 8))
def test_a_row_between_changes_nothing(lag, voltage, row):
    time_s = np.arange(len(voltage)) * 0.1
    row = min(row, len(voltage) - 2)
    halved = np.insert(time_s, row + 1, time_s[row] + 0.04)
    doubled = np.insert(voltage, row + 1, voltage[row])
    readings = np.delete(drive(lag(), halved, doubled), row + 1)
    np.testing.assert_allclose(readings, drive(lag(), time_s, voltage), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("input_hold", ["hold", "linear"])
def test_a_record_is_its_columns(lag, input_hold):
    record = Record(UNEVEN_S, VOLTAGE, np.zeros(6), command_time_s=np.minimum(LATE_S, [*UNEVEN_S[1:], math.inf]))
    np.testing.assert_array_equal(
        drive_record(lag(), record, input_hold=input_hold, ramp_steps=4),
        drive(lag(), UNEVEN_S, VOLTAGE, command_time_s=record.command_time_s, input_hold=input_hold, ramp_steps=4),
    )


@given(start=st.floats(-100.0, 100.0), step_s=st.floats(1e-4, 10.0), count=st.integers(1, 300))
def test_a_raster_gives_one_step(start, step_s, count):
    steps = even_steps(start + np.arange(count + 1) * step_s)
    assert len(steps) == count
    assert len(set(steps)) == 1
    assert steps[0] == pytest.approx(step_s, rel=1e-8)


def test_decimal_times_give_decimal_steps():
    assert even_steps(np.array([0.0, 0.033333, 0.066667, 0.1])) == [0.033333, 0.033334, 0.033333]
    assert even_steps(np.array([10.1, 10.2, 10.4])) == [0.1, 0.2]
    assert even_steps(np.array([0.0, 1e-14, 1.0])) == [1e-14, 1.0]


@pytest.mark.parametrize(
    ("arguments", "more", "message"),
    [
        (([0.0, 1.0], [0.0]), {}, "equal lengths, found 2, 1 and 2"),
        (([0.0, 1.0], [0.0, 1.0]), {"input_hold": "cubic"}, "input_hold must be 'hold' or 'linear', found 'cubic'"),
        (([0.0, 1.0], [0.0, 1.0]), {"ramp_steps": 0}, "ramp_steps must be at least 1, found 0"),
    ],
)
def test_bad_arguments(lag, arguments, more, message):
    with pytest.raises(ValueError, match=message):
        drive(lag(), *arguments, **more)
