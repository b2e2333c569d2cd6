"""The voltage that acts at a row, against a plain walk through the commands."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.records.acting_voltage import acting_V, direction

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
    late_s = time_s + rng.uniform(0.0, 0.009, len(levels)) * rng.integers(0, 2)
    found = acting_V(time_s, late_s, np.array(levels))
    assert found.tolist() == [walked(t, late_s.tolist(), levels) for t in time_s.tolist()]


@given(volts)
def test_without_times_of_their_own_commands_act_one_row_later(levels: list[float]):
    time_s = np.arange(len(levels), dtype=float)
    assert acting_V(time_s, time_s, np.array(levels)).tolist() == [0.0, *levels[:-1]]


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
