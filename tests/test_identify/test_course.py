"""What the input does between the rows: held, unless readings answer the input of their own row."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_identify.first_model.course import course_between_rows, experiments_of
from bender_loop.records.record import Record

ROW_s, NOISE = 0.01, 0.01


def lagged(drive: np.ndarray, tau_s: float, *, held: bool) -> np.ndarray:
    """Return readings behind a lag by an exact step: of a held input, or of one that is straight from row to row."""
    kept = np.exp(-ROW_s / tau_s)
    ramp = 1.0 - (1.0 - kept) * tau_s / ROW_s
    read = [0.0]
    for before, now in itertools.pairwise(drive):
        read.append(kept * read[-1] + (1.0 - kept) * before + (0.0 if held else ramp * (now - before)))
    return np.array(read)


def recorded(drive: np.ndarray, read: np.ndarray, rng: np.random.Generator) -> Record:
    return Record(
        ROW_s * np.arange(drive.size, dtype=np.float64), drive, 3.0 * read + NOISE * rng.standard_normal(drive.size)
    )


@settings(max_examples=3, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.3, 3.0))
def test_noise_through_a_lag_is_read_as_what_it_was(seed: int, rows_per_lag: float):
    rng = np.random.default_rng(seed)
    drive = np.concatenate([[0.0], rng.uniform(-5.0, 5.0, 500)])
    for held, course in ((True, "hold"), (False, "linear")):
        record = recorded(drive, lagged(drive, rows_per_lag * ROW_s, held=held), rng)
        assert course_between_rows([record]) == course


def test_levels_that_are_read_in_their_own_row_do_not_hang_behind():
    rng = np.random.default_rng(3)
    drive = np.repeat(np.concatenate([[0.0], rng.uniform(-5.0, 5.0, 40)]), 15)
    assert course_between_rows([recorded(drive, np.tanh(0.2 * drive), rng)]) == "linear"
    assert course_between_rows([recorded(drive, np.roll(np.tanh(0.2 * drive), 1), rng)]) == "hold"


def test_a_smooth_input_far_above_the_rows_is_held_whatever_it_was():
    rng = np.random.default_rng(4)
    drive = 5.0 * np.sin(np.arange(800) / 25.0)
    assert course_between_rows([recorded(drive, lagged(drive, 20.0 * ROW_s, held=False), rng)]) == "hold"


@pytest.mark.parametrize(("asked", "found"), [("hold", "hold"), ("auto", "linear"), ("smooth", "smooth")])
def test_what_is_asked_for_is_taken(asked, found):
    rng = np.random.default_rng(5)
    drive = rng.uniform(-5.0, 5.0, 300)
    record = recorded(drive, drive, rng)
    assert [x.input_hold for x in experiments_of([record], ["noise.csv"], asked)] == [found]
