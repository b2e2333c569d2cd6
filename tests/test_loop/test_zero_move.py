"""A sensor whose zero moved: found where nothing else can be the cause, taken out to the noise, else left alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from scipy.signal import lfilter

from bender_loop.records.record import Record
from bender_loop.records.zero_move import without_zero_move, zero_move


def answering(rng: np.random.Generator, rows: int, lag_rows: float, noise: float, dwell: int = 9) -> Record:
    """A lag under random levels, with outlying and lost readings."""
    command = rng.uniform(-20.0, 30.0, rows // dwell + 1).repeat(dwell)[:rows]
    decay = np.exp(-1.0 / lag_rows)
    read = lfilter([0.0, 0.4 * (1.0 - decay)], [1.0, -decay], command) + noise * rng.standard_normal(rows)
    read[rng.integers(0, rows, 3)] = np.nan
    read[rng.integers(0, rows, 2)] += 300.0
    return Record(np.linspace(0.0, 0.1 * rows, rows), command, read)


@given(
    st.integers(0, 10**6), st.integers(200, 900), st.floats(0.5, 8.0), st.floats(0.3, 0.7), st.floats(8.0, 1e4),
    st.sampled_from((-1.0, 1.0)),
)  # fmt: skip
@examples(max_examples=40, deadline=None)
def test_a_jump_is_found_at_its_row_and_taken_out(
    seed: int, rows: int, lag_rows: float, place: float, spans: float, sign: float
) -> None:
    record = answering(np.random.default_rng(seed), rows, lag_rows, 0.05)
    row, height = round(place * rows), sign * spans * 20.0
    jumped = Record(
        record.time_s, record.voltage_V, record.displacement_um + np.where(np.arange(rows) >= row, height, 0.0)
    )
    steady = without_zero_move(jumped)
    assert steady.zero_move is not None
    # a lost reading leaves the row open
    assert abs(steady.zero_move.row - row) <= 2
    assert steady.zero_move.height_um == pytest.approx(height, abs=1.5)
    assert without_zero_move(steady) is steady


@given(st.integers(0, 10**6), st.integers(40, 600), st.floats(0.5, 200.0), st.integers(1, 60))
@examples(max_examples=60, deadline=None)
def test_what_a_device_answers_is_no_jump(seed: int, rows: int, lag_rows: float, dwell: int) -> None:
    record = answering(np.random.default_rng(seed), rows, lag_rows, 0.05, dwell)
    assert zero_move(record) is None
    assert without_zero_move(record) is record


@pytest.mark.parametrize("late_rows", [0, 30])
def test_one_step_of_the_command_is_no_jump_however_late_it_is_answered(late_rows: int) -> None:
    command = np.repeat([0.0, 10.0], [60, 140])
    read = np.repeat([0.0, 50.0], [60 + late_rows, 140 - late_rows]) + 0.1 * np.sin(np.arange(200.0))
    assert zero_move(Record(np.linspace(0.0, 20.0, 200), command, read)) is None
