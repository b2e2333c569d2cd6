"""Readings that a logger took twice are lost but for the first; equal readings of other causes stay."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bender_compiled.simulation import Drive, Simulator
from bender_loop.records.record import Record
from bender_loop.records.repeated_readings import without_repeats
from bender_plant.model import load_model

ROWS = 600
TIME_S = np.arange(ROWS) / 30.0
COMMAND_V = 25.0 + 20.0 * np.sin(1.3 * TIME_S) + 4.0 * np.sin(7.1 * TIME_S)


def read(seed: int, noise_um: float = 0.05) -> np.ndarray:
    return 0.47 * COMMAND_V + noise_um * np.random.default_rng(seed).standard_normal(ROWS)


@example(seed=130, rows_each=5.0, digits=3)
@given(seed=st.integers(0, 10_000), rows_each=st.sampled_from([1.7, 2.0, 2.4, 3.0, 5.0]), digits=st.integers(3, 9))
def test_a_sensor_that_is_slower_than_the_rows_is_read_once(seed: int, rows_each: float, digits: int) -> None:
    fresh = np.floor(np.arange(ROWS) / rows_each + 1e-9).astype(int)
    first = np.flatnonzero(np.diff(fresh, prepend=-1))
    whole = np.round(read(seed), digits)
    taken = np.asarray(whole[first][fresh], dtype=np.float64)
    record = without_repeats(Record(TIME_S, COMMAND_V, taken))
    kept = np.flatnonzero(np.isfinite(record.displacement_um))
    # two fresh readings may be alike by chance
    assert set(kept) <= set(first)
    assert len(first) - len(kept) <= 0.05 * len(first)
    assert record.repeats == ROWS - len(kept)
    assert np.array_equal(record.displacement_um[kept], whole[kept])


@pytest.mark.parametrize(
    "readings",
    [
        read(1),
        np.round(read(2) / 0.7) * 0.7,
        np.round(read(3) / 0.05) * 0.05,
        Simulator(Drive.of_rows(TIME_S, COMMAND_V)).run(load_model("beam").with_block("backlash", half_width_um=2.0))
        .reading_um,
        np.where(np.arange(ROWS) % 50 < 2, 3.0, read(4)),
    ],
    ids=["every row", "coarse", "fine steps", "plays without noise", "now and then"],
)  # fmt: skip
def test_equal_readings_of_other_causes_stay(readings: np.ndarray) -> None:
    record = Record(TIME_S, COMMAND_V, readings)
    assert without_repeats(record) is record


def test_under_a_held_command_a_reading_may_stand() -> None:
    levels = np.random.default_rng(5).uniform(0.0, 50.0, ROWS // 4).repeat(4)
    record = Record(TIME_S, levels, 0.47 * np.append(0.0, levels[:-1]))
    assert without_repeats(record) is record
