"""A plant on a raster: one step under one command; a reading at the instant of a command knows nothing of it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from bender_loop.records.raster import drive_raster, raster_step_s

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


class Static:
    """y = 2 u, at once."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._shown = 0.0

    def read(self) -> float:
        return self._shown

    def step(self, voltage_V: float, step_s: float) -> float:
        del step_s
        self._shown = 2.0 * voltage_V
        return self._shown

    def close(self) -> None:
        pass


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
def test_a_reading_at_the_instant_of_a_command_is_that_of_the_command_before(count: int, seed: int, parts: int) -> None:
    times, volts = uneven_rows(count, seed)
    found = drive_raster(Static(), times, times, volts, False, raster_step_s(times, 0.02 / parts))
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


def test_a_command_that_runs_straight_is_met_in_every_step() -> None:
    times = 0.1 * np.arange(11, dtype=np.float64)
    plant = Static()
    found = drive_raster(plant, times, times, 10.0 * times, True, 0.01)
    # the mean over the last step is that of its middle
    assert found[1:] == pytest.approx(20.0 * (times[1:] - 0.005), abs=1e-9)
