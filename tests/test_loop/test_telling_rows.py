"""Which rows of a long record are read, and how much of its command is simulated."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from bender_loop.records.telling_rows import STRETCH_ROWS, changing_commands, telling_rows, telling_window

levels = arrays(np.float64, st.integers(1, 400), elements=st.integers(0, 3).map(float))


@given(levels, st.integers(1, 500), st.integers(0, 99))
def test_rows_are_in_order_within_what_is_asked_for_and_from_the_beginning(volts: np.ndarray, most: int, seed: int):
    read = np.random.default_rng(seed).random(volts.size) > 0.2
    rows = telling_rows(volts, read, most)
    assert np.all(np.diff(rows) > 0)
    assert rows[0] == 0
    assert rows[-1] < volts.size
    assert rows.size <= max(most, STRETCH_ROWS)
    if most >= volts.size:
        assert rows.size == volts.size


def staircase_and_triangles() -> np.ndarray:
    """Twelve levels of 1200 rows, then quick cycles of 150 rows."""
    up = np.linspace(0.0, 100.0, 7)
    stairs = np.repeat(np.concatenate([up[1:], up[-2::-1]]), 1200)
    cycle = 100.0 * (1.0 - np.abs(np.linspace(-1.0, 1.0, 150, endpoint=False)))
    return np.concatenate([np.zeros(100), stairs, np.tile(cycle, 90)])


def test_steps_holds_and_every_phase_of_a_cycle_are_read() -> None:
    volts = staircase_and_triangles()
    rows = telling_rows(volts, np.ones(volts.size, dtype=np.bool_), 6_000)
    assert rows.size == pytest.approx(6_000, rel=0.1)
    steps = np.flatnonzero(np.abs(np.diff(volts)) > 10.0) + 1
    for begin in steps:
        age = rows[(rows >= begin) & (rows < begin + 1200)] - begin
        # at once, and in every part of the time that it is held, as long as it is old
        for low, high in ((0, 8), (8, 75), (75, 600), (600, 1200)):
            assert np.any((age >= low) & (age < high))
    phases = (rows[rows >= 14_500] - 14_500) % 150
    seen = np.bincount(phases // 15, minlength=10)
    assert seen.min() > 0.5 * seen.mean()


@given(levels, st.integers(1, 500), st.integers(0, 99))
def test_a_window_holds_as_many_rows_and_changes_as_may_be(volts: np.ndarray, most_rows: int, most_changes: int):
    window = telling_window(volts, np.ones(volts.size, dtype=np.bool_), most_rows, most_changes)
    within = volts[window]
    assert 0 <= window.start < window.stop <= volts.size
    assert within.size <= most_rows
    assert np.count_nonzero(np.diff(within)) <= most_changes
    if volts.size <= most_rows and np.count_nonzero(np.diff(volts)) <= most_changes:
        assert within.size == volts.size


@given(levels, st.booleans())
def test_the_commands_that_change_tell_all_of_them(volts: np.ndarray, linear: bool) -> None:
    told = changing_commands(volts, linear)
    rows = np.arange(volts.size)
    if linear:
        assert np.interp(rows, told, volts[told]) == pytest.approx(volts)
    else:
        assert np.array_equal(volts[told][np.searchsorted(told, rows, side="right") - 1], volts)
