"""A plant driven by a record or on a raster: the convention of the rows, ramps, late commands, uneven steps."""

import math

import numpy as np
import pytest
import scipy.integrate
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from bender_loop.records.acting_voltage import acting_V, direction
from bender_loop.records.drive import drive, drive_record, even_steps
from bender_loop.records.raster import drive_raster, raster_step_s
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


def test_a_row_is_read_before_its_voltage_acts(doubling):
    plant = doubling()
    assert drive(plant, [0.0, 1.0, 3.0], [5.0, 7.0, 9.0]).tolist() == [0.0, 10.0, 14.0]
    assert plant.steps == [(5.0, 1.0), (7.0, 2.0)]


def test_a_ramp_has_arrived_when_the_row_is_read(doubling):
    plant = doubling()
    readings = drive(plant, [0.0, 1.0, 3.0], [5.0, 7.0, 9.0], input_hold="linear")
    assert readings.tolist() == [0.0, 14.0, 18.0]
    assert sum(step_s for _, step_s in plant.steps) == pytest.approx(3.0)


def test_the_first_row_is_what_the_plant_reads_at_rest(lag):
    assert drive(lag(rest_um=2.5), [3.0, 4.0], [0.0, 0.0]).tolist() == [2.5, 2.5]


@given(shift=st.floats(-100.0, 100.0))
def test_the_clock_starts_with_the_first_row(lag, shift):
    np.testing.assert_allclose(
        drive(lag(), UNEVEN_S + shift, VOLTAGE), drive(lag(), UNEVEN_S, VOLTAGE), rtol=1e-9, atol=1e-9
    )


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


volts = st.lists(st.floats(-50.0, 50.0), min_size=2, max_size=30)


def walked(row_s: float, commands_s: list[float], levels: list[float]) -> float:
    """The last command that acted before an instant, 0 V before the first."""
    found = 0.0
    for command_s, level in zip(commands_s, levels, strict=True):
        if command_s < row_s:
            found = level
    return found


@given(volts, st.integers(0, 2**32 - 1))
def test_a_held_voltage_is_the_last_that_was_commanded_before_the_row(levels: list[float], seed: int):
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.uniform(0.01, 1.0, len(levels)))
    # half of them have no times of their own: these commands act one row later
    late_s = time_s + rng.uniform(0.0, 0.009, len(levels)) * rng.integers(0, 2)
    found = acting_V(time_s, late_s, np.array(levels))
    assert found.tolist() == [walked(t, late_s.tolist(), levels) for t in time_s.tolist()]


@given(volts)
def test_a_straight_voltage_is_read_on_its_line(levels: list[float]):
    time_s = np.arange(len(levels), dtype=float)
    assert acting_V(time_s, time_s, np.array(levels), linear=True).tolist() == levels
    between = acting_V(time_s[1:] - 0.5, time_s, np.array(levels), linear=True)
    assert between == pytest.approx(0.5 * (np.array(levels)[1:] + np.array(levels)[:-1]))


def test_the_direction_is_that_of_the_last_change():
    assert direction(np.array([1.0, 1.0, 2.0, 2.0, 0.0, 0.0, 3.0])).tolist() == [1, 1, 1, 1, -1, -1, 1]
    assert direction(np.array([2.0, 2.0, 1.0])).tolist() == [-1, -1, -1]
    assert direction(np.array([2.0, 2.0])).tolist() == [1, 1]


OMEGA, ZETA = 2.0 * math.pi * 104.0, 0.02


class Oscillator:
    """q'' + 2 zeta omega q' + omega^2 q = omega^2 u, exact under a held u; it counts the steps that it is asked for."""

    def __init__(self) -> None:
        self._a = np.array([[0.0, 1.0, 0.0], [-(OMEGA**2), -2.0 * ZETA * OMEGA, OMEGA**2], [0.0, 0.0, 0.0]])
        self.steps_s: list[float] = []
        self.reset()

    def reset(self) -> None:
        self._state = np.zeros(2)

    def read(self) -> float:
        return float(self._state[0])

    def step(self, voltage_V: float, step_s: float) -> float:
        self.steps_s.append(step_s)
        self._state = (expm(self._a * step_s) @ np.array([*self._state, voltage_V]))[:2]
        return self.read()

    def close(self) -> None:
        pass


@pytest.fixture(scope="session")
def doubling(lag):
    """y = 2 u, at once."""
    return lambda: lag(gain_um_per_V=2.0, feedthrough=1.0)


def uneven_rows(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.02, 0.05, count))
    return times - times[0], rng.uniform(0.0, 50.0, count)


def exact(row_time_s: np.ndarray, voltage_V: np.ndarray) -> np.ndarray:
    plant = Oscillator()
    between = np.diff(row_time_s).tolist()
    return np.array([0.0, *(plant.step(float(u), h) for u, h in zip(voltage_V, between, strict=False))])


def test_even_rows_are_exact_in_few_steps() -> None:
    times, volts = 0.02 * np.arange(40, dtype=np.float64), uneven_rows(40, 1)[1]
    plant = Oscillator()
    found = drive_raster(plant, times, times, volts, False, raster_step_s(times, 0.02 / 64))
    assert found == pytest.approx(exact(times, volts), abs=1e-8)
    assert len(plant.steps_s) < 6 * times.size


@pytest.mark.slow
@pytest.mark.parametrize("parts", [1, 64])
def test_rows_whose_times_are_printed_to_microseconds_stay_on_the_raster(parts: int) -> None:
    """For ten minutes: a raster of the usual distance between them is off by a tenth of a row in the end."""
    count = 18_000
    times = np.round(np.arange(count) / 30.0, 6)
    volts = np.repeat(np.random.default_rng(3).uniform(0.0, 50.0, count // 9), 9)
    plant = Oscillator()
    step_s = raster_step_s(times, 1.0 / 30.0 / parts * (1.0 + 1e-6))
    found = drive_raster(plant, times, times, volts, False, step_s)
    assert step_s == pytest.approx(1.0 / 30.0 / parts, rel=1e-8)
    assert found == pytest.approx(exact(times, volts), abs=0.05)


@given(st.integers(3, 30), st.integers(0, 10**6), st.integers(8, 80))
def test_steps_are_multiples_of_the_raster_and_cover_the_record(count: int, seed: int, parts: int) -> None:
    times, volts = uneven_rows(count, seed)
    step_s = raster_step_s(times, 0.03 / parts)
    plant = Oscillator()
    drive_raster(plant, times, times, volts, False, step_s)
    multiples = np.array(plant.steps_s) / step_s
    assert multiples == pytest.approx(np.round(multiples), abs=1e-9)
    assert multiples.sum() == pytest.approx(np.ceil(times[-1] / step_s * (1.0 - 1e-9)))


@given(st.integers(3, 30), st.integers(0, 10**6), st.integers(8, 80))
def test_a_reading_at_the_instant_of_a_command_is_that_of_the_command_before(
    doubling, count: int, seed: int, parts: int
) -> None:
    times, volts = uneven_rows(count, seed)
    found = drive_raster(doubling(), times, times, volts, False, raster_step_s(times, 0.02 / parts))
    assert found[1:] == pytest.approx(2.0 * volts[:-1], abs=1e-9)


def test_the_ringing_between_uneven_rows_comes_nearer_with_the_square_of_the_step() -> None:
    times, volts = uneven_rows(60, 3)
    true = exact(times, volts)
    off = []
    for parts in (64, 128, 256):
        found = drive_raster(Oscillator(), times, times, volts, False, raster_step_s(times, 0.033 / parts))
        off.append(float(np.std(found - true) / np.std(true)))
    # a step takes the mean of its command; the error is the first moment, on average (omega h)^2 / 12 of the ringing
    assert off[0] < (OMEGA * 0.033 / 64) ** 2 / 4.0
    assert off[1] < off[0] / 2.5
    assert off[2] < off[1] / 2.5


def test_a_command_that_runs_straight_is_met_in_every_step(doubling) -> None:
    times = 0.1 * np.arange(11, dtype=np.float64)
    found = drive_raster(doubling(), times, times, 10.0 * times, True, 0.01)
    # the mean over the last step is that of its middle
    assert found[1:] == pytest.approx(20.0 * (times[1:] - 0.005), abs=1e-9)
