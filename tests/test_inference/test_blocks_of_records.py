"""Which blocks of records are fitted, chosen on and reported on; lines of their commands; their names."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import levels, record_of, told

from bender_inference.records.command_lines import command_lines_Hz
from bender_inference.records.observations import observe
from bender_inference.records.record_names import distinct_names
from bender_inference.records.roles import (
    APART,
    BLOCKS,
    CHOSEN,
    FIRST,
    LEAST_READINGS,
    MOST_STRETCHES,
    REPORTED,
    blocks_of,
    folds_of,
    held_out_and_reported,
)


def commands(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    steps = rng.uniform(0.0, 50.0, count // 7 + 1).repeat(7)[:count]
    return np.where(np.arange(count) < rng.integers(0, count // 2), 0.0, steps)


def unread(count: int, share: float, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).random(count) >= share


@given(st.integers(60, 5000), st.floats(0.0, 0.4), st.integers(0, 999))
@examples(max_examples=25)
def test_blocks_are_held_out_apart_from_one_another(count: int, share: float, seed: int) -> None:
    read = unread(count, share, seed)
    blocks = folds_of(read)
    held_out, reported = held_out_and_reported(read, commands(count, seed))
    assert not np.any(reported & ~held_out)
    own, chosen = np.unique(blocks[reported]), np.unique(blocks[held_out & ~reported])
    assert (own.size, chosen.size) == (REPORTED, CHOSEN)
    assert np.min(np.diff(own)) > 2 * APART
    assert np.min(np.diff(chosen)) >= APART
    assert min(own[0], chosen[0]) >= FIRST
    # whole blocks have one role
    assert all(held_out[blocks == k].all() for k in (*own, *chosen))


@given(st.integers(40, 5000), st.floats(0.0, 0.4), st.integers(0, 999))
@examples(max_examples=25)
def test_blocks_have_as_many_readings_as_one_another(count: int, share: float, seed: int) -> None:
    read = unread(count, share, seed)
    blocks = blocks_of(read)
    assert np.all(np.diff(blocks) >= 0)
    sizes = np.bincount(blocks[read], minlength=BLOCKS)
    assert sizes.max() - sizes.min() <= 1


def test_what_is_held_out_is_nearer_to_the_whole_than_blocks_drawn_at_random() -> None:
    """Levels of records that stand still for a part of their time; how many of the draws are nearer."""
    nearer = []
    for seed in range(12):
        volts, read = commands(4000, seed), np.ones(4000, dtype=np.bool_)
        held_out, reported = held_out_and_reported(read, volts)
        blocks, rng = folds_of(read), np.random.default_rng(seed)
        for rows, count in ((reported, REPORTED), (held_out & ~reported, CHOSEN)):
            drawn = [np.isin(blocks, rng.choice(np.arange(1, BLOCKS), count, replace=False)) for _ in range(100)]
            off = np.array([abs(volts[x].mean() - volts.mean()) for x in drawn])
            nearer.append(float(np.mean(off < abs(volts[rows].mean() - volts.mean()))))
    assert np.mean(nearer) < 0.35


def test_nothing_but_the_command_decides() -> None:
    """Its scale and level do not: what was read is not asked."""
    volts, read = commands(1000, 3), np.ones(1000, dtype=np.bool_)
    first = held_out_and_reported(read, volts)
    again = held_out_and_reported(read, 5.0 + 0.1 * volts)
    assert all(np.array_equal(x, y) for x, y in zip(first, again, strict=True))
    flat = held_out_and_reported(read, np.full(1000, 7.0))
    assert 0.3 < flat[0].mean() < 0.4


@given(st.integers(60, 40_000), st.floats(0.0, 0.4), st.integers(0, 99))
@examples(max_examples=20)
def test_folds_hold_stretches_of_equal_length(count: int, share: float, seed: int) -> None:
    read = unread(count, share, seed)
    folds = folds_of(read)
    sizes = np.bincount(folds[read], minlength=BLOCKS)
    assert sizes.max() - sizes.min() <= MOST_STRETCHES
    stretches = 1 + int(np.count_nonzero(np.diff(folds)))
    readings = int(read.sum())
    assert stretches == BLOCKS * min(max(readings // (BLOCKS * LEAST_READINGS), 1), MOST_STRETCHES)
    if stretches == BLOCKS:
        assert np.array_equal(folds, blocks_of(read))


def test_what_happens_once_in_a_long_record_is_fitted_and_held_out() -> None:
    """A burst of a sixteenth of the record."""
    read, volts = np.ones(25_600, dtype=np.bool_), np.zeros(25_600)
    for begin in range(2_000, 22_000, 3_000):
        burst = slice(begin, begin + 1_600)
        volts[burst] = np.sin(0.05 * np.arange(1_600))
        held_out, _ = held_out_and_reported(read, volts)
        assert 0.3 < np.mean(~held_out[burst]) < 1.0
        volts[burst] = 0.0


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (["a.csv"], ["a.csv"]),
        (["runs/a.csv", "other/b.csv"], ["a.csv", "b.csv"]),
        (["monday/record.csv", "tuesday/record.csv"], ["monday/record.csv", "tuesday/record.csv"]),
        (
            ["x/monday/record.csv", "y/monday/record.csv", "c.csv"],
            ["x/monday/record.csv", "y/monday/record.csv", "c.csv"],
        ),
        (["record.csv", "monday/record.csv"], ["record.csv", "monday/record.csv"]),
        (["record.csv", "record.csv"], ["record.csv", "record.csv"]),
        (["record 1", "record 2"], ["record 1", "record 2"]),
        ([], []),
    ],
)
def test_names_are_as_short_as_distinguishes_them(names, told):
    assert distinct_names(names) == told


@given(
    st.lists(st.integers(0, 11), min_size=2, max_size=4, unique=True), st.integers(0, 10**6), st.floats(0.0, 1.0),
    st.sampled_from((200, 900, 3000)),
)  # fmt: skip
@examples(max_examples=25)
def test_a_few_sines_are_found_by_their_frequencies(places: list[int], seed: int, grows: float, rows: int) -> None:
    rng = np.random.default_rng(seed)
    # a few lines of a record apart, and slow beside the rows
    cycles = np.array([5.0 + 4.0 * k + rng.uniform(-0.8, 0.8) for k in places])
    time_s = np.linspace(0.0, 20.0, rows)
    waves = np.sin(2.0 * np.pi * np.outer(time_s, cycles / 20.0) + rng.uniform(0.0, 6.0, cycles.size))
    command = 25.0 + 10.0 * (1.0 - grows + grows * time_s / 20.0) * (waves @ rng.uniform(0.6, 1.0, cycles.size))
    found = np.sort(command_lines_Hz(time_s, command))
    assert found.size == cycles.size
    np.testing.assert_allclose(found, np.sort(cycles) / 20.0, atol=0.2 / 20.0)


@given(st.integers(0, 10**6), st.sampled_from((300, 1200)), st.integers(2, 30))
@examples(max_examples=25)
def test_levels_and_noise_have_no_lines(seed: int, rows: int, dwell: int) -> None:
    rng = np.random.default_rng(seed)
    command = rng.uniform(0.0, 50.0, rows // dwell + 1).repeat(dwell)[:rows]
    assert command_lines_Hz(np.arange(rows) / 30.0, command) == ()


@pytest.mark.parametrize("command", [np.zeros(300), np.full(300, 4.0), np.arange(20.0)])
def test_what_hardly_moves_or_is_short_has_no_lines(command: np.ndarray) -> None:
    assert command_lines_Hz(np.arange(command.size) / 30.0, command) == ()


def test_readings_that_are_set_aside_leave_the_others_in_their_folds() -> None:
    record = record_of(voltage_V=levels(2000 / 30.0))
    seen = observe(record)
    stray = np.arange(seen.usable.size) < 40
    kept = seen.without(stray)
    assert np.array_equal(kept.folds, seen.folds)
    assert len(np.unique(kept.folds[kept.reporting])) == REPORTED
    # cut again, they would fall apart into halves
    assert len(np.unique(folds_of(kept.usable)[kept.reporting])) > REPORTED


def test_every_block_of_a_prediction_has_the_rows_that_count() -> None:
    record = record_of()
    search = told([record])
    found = search.archive.prediction(search.best)
    assert found is not None
    assert found.rows.sum() == search.problem.all_rows
    assert found.blocks.size == found.rows.size == BLOCKS - REPORTED
    assert found.blocks.sum() == pytest.approx(found.square)
