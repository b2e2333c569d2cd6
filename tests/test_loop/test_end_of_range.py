"""Readings at the end of the sensor's range, and what only looks like it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_loop.records.end_of_range import EndOfRange, ends_of_range
from bender_loop.records.record import Record

TIME_s = np.arange(900) / 30.0
SWING_V = 20.0 + 12.0 * np.sin(0.9 * TIME_s) + 6.0 * np.sin(2.3 * TIME_s)


def noisy(seed: int, noise: float = 0.05, step: float = 1e-4) -> np.ndarray:
    read = 0.4 * SWING_V + noise * np.random.default_rng(seed).standard_normal(TIME_s.size)
    return step * np.round(read / step)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    share=st.floats(0.5, 0.85),
    unit=st.sampled_from([1e-6, 1.0, 1e5]),
    flipped=st.booleans(),
)
def test_a_sensor_at_its_end_is_told_on_either_side_in_any_unit(seed: int, share: float, unit: float, flipped: bool):
    sign = -1.0 if flipped else 1.0
    read = noisy(seed)
    level = float(np.round(np.quantile(read, share), 4))
    clipped = sign * unit * np.minimum(read, level)
    (found,) = ends_of_range(Record(TIME_s, SWING_V, clipped))
    assert found.side == ("below" if flipped else "above")
    assert found.value == sign * unit * level
    assert found.rows == int(np.sum(read >= level))
    assert np.all(clipped[found.first : found.first + 5] == found.value)


@given(
    seed=st.integers(0, 10_000), noise=st.sampled_from([0.0, 1e-3, 0.05, 1.0]), step=st.sampled_from([1e-6, 0.01, 0.5])
)
@settings(max_examples=60, deadline=None)
def test_what_is_not_cut_off_is_at_no_end(seed: int, noise: float, step: float):
    assert ends_of_range(Record(TIME_s, SWING_V, noisy(seed, noise, step))) == []


def play(command: np.ndarray, half_width: float) -> np.ndarray:
    at, found = command[0], []
    for x in command:
        at = min(max(at, x - half_width), x + half_width)
        found.append(at)
    return np.array(found)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_play_that_is_crossed_and_a_device_at_rest_are_no_end(noise: float):
    rng = np.random.default_rng(1)
    triangle = 10.0 * np.abs((TIME_s / 3.0) % 2.0 - 1.0)
    read = play(triangle, 1.5) + noise * rng.standard_normal(TIME_s.size)
    assert ends_of_range(Record(TIME_s, triangle, read)) == []
    still = np.where(TIME_s < 10.0, 0.0, SWING_V)
    # a clean zero before anything moves is no end: the command stands as well
    assert ends_of_range(Record(TIME_s, still, np.where(TIME_s < 10.0, 0.0, 5.0 + noisy(3, noise)))) == []


def test_lost_readings_and_short_records_do_not_disturb():
    read = np.minimum(noisy(5), 9.0)
    read[::7] = np.nan
    (found,) = ends_of_range(Record(TIME_s, SWING_V, read))
    assert isinstance(found, EndOfRange)
    assert (found.side, found.value) == ("above", 9.0)
    assert ends_of_range(Record(TIME_s[:6], SWING_V[:6], read[:6])) == []
