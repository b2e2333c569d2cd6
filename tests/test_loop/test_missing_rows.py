"""Rows that a logger has lost are put in where the command cannot have been held meanwhile."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.records.further import Further
from bender_loop.records.missing_rows import MOST_AT_ONCE, completed, without_remembered
from bender_loop.records.record import Record
from bender_loop.records.replay import replay

ROWS = 400


def moving(jitter_s: float = 0.0, seed: int = 1) -> Record:
    rng = np.random.default_rng(seed)
    time_s = 0.01 * np.arange(ROWS) + jitter_s * rng.uniform(-1.0, 1.0, ROWS)
    voltage_V = np.abs(np.arange(ROWS) % 100 - 50.0)
    return Record(time_s, voltage_V, rng.standard_normal(ROWS))


def without(record: Record, missing: np.ndarray) -> Record:
    kept = np.setdiff1d(np.arange(len(record)), missing)
    return Record(*(x[kept] for x in (record.time_s, record.voltage_V, record.displacement_um)))  # pyright: ignore[reportArgumentType]


def commanded(volts: np.ndarray, missing: np.ndarray) -> Record:
    """Return a record of other commands that lacks these rows, one every 10 ms."""
    time_s = 0.01 * np.arange(float(volts.size))
    return without(Record(time_s, np.asarray(volts, dtype=np.float64), np.zeros(volts.size)), missing)


@given(missing=st.sets(st.integers(1, ROWS - 2), min_size=1, max_size=20), jitter_s=st.sampled_from([0.0, 5e-4]))
def test_every_missing_row_is_put_in_its_place_without_a_reading(missing: set[int], jitter_s: float) -> None:
    whole, rows = moving(jitter_s), np.array(sorted(missing))
    found = completed(without(whole, rows))
    assert len(found) == ROWS
    assert found.made_up is not None
    assert np.flatnonzero(found.made_up).tolist() == rows.tolist()
    assert np.isnan(found.displacement_um[rows]).all()
    kept = ~found.made_up
    for name in ("time_s", "voltage_V", "displacement_um"):
        assert np.array_equal(getattr(found, name)[kept], getattr(whole, name)[kept])
    assert np.all(np.diff(found.time_s) > 0.0)
    # the command turns at every fiftieth row; elsewhere it runs straight
    straight = rows[[all((k + d) % 50 for d in range(-20, 21)) for k in rows]]
    assert found.voltage_V[straight] == pytest.approx(whole.voltage_V[straight], abs=1e-9)


@pytest.mark.parametrize("missing", [1, 4])
def test_a_smooth_command_is_bridged_by_a_smooth_one(missing: int) -> None:
    time_s = moving().time_s
    swing = Record(time_s, np.asarray(20.0 * np.sin(8.0 * time_s), dtype=np.float64), np.zeros(ROWS))
    rows = np.concatenate([k + np.arange(missing) for k in (19, 120, 301)])
    found = completed(without(swing, rows))
    straight = np.interp(rows, np.delete(np.arange(ROWS), rows), np.delete(swing.voltage_V, rows))
    assert np.max(np.abs(found.voltage_V - swing.voltage_V)) < 0.02 * np.max(np.abs(straight - swing.voltage_V[rows]))
    assert np.array_equal(np.delete(found.voltage_V, rows), np.delete(swing.voltage_V, rows))


def test_a_command_without_a_course_is_bridged_by_a_straight_line() -> None:
    volts = np.random.default_rng(3).uniform(0.0, 50.0, ROWS)
    found = completed(without(Record(moving().time_s, volts, np.zeros(ROWS)), np.array([40, 41])))
    assert found.voltage_V[40:42] == pytest.approx(np.interp([40, 41], [39, 42], volts[[39, 42]]))


def test_what_goes_with_the_rows_goes_with_those_that_are_put_in() -> None:
    whole = moving()
    kept = np.delete(np.arange(ROWS), [100, 101])
    record = Record(
        whole.time_s[kept], whole.voltage_V[kept], whole.displacement_um[kept],
        command_time_s=whole.time_s[kept] + 0.004, temperature_C=np.full(kept.size, 20.0),
        exposure_s=np.full(kept.size, 0.002), further=(Further("load", "N", whole.time_s[kept]),),
    )  # fmt: skip
    found = completed(record)
    assert found.command_time_s == pytest.approx(whole.time_s + 0.004)
    assert found.exposure == 0.002
    assert found.further[0].values == pytest.approx(whole.time_s)
    assert found.temperature_C is not None
    assert np.isnan(found.temperature_C[[100, 101]]).all()


def test_a_command_that_came_late_in_a_gap_acts_before_the_row_that_is_put_in() -> None:
    whole = moving()
    kept = np.delete(np.arange(ROWS), [100])
    acting_s = whole.time_s[kept] + 0.002
    acting_s[99] += 0.014
    record = Record(whole.time_s[kept], whole.voltage_V[kept], whole.displacement_um[kept], command_time_s=acting_s)
    found = completed(record)
    assert found.command_time_s is not None
    assert found.command_time_s[99] == found.time_s[100]


STEPS_V = np.repeat(np.arange(10.0), 40)
STOOD_V = np.where((np.arange(ROWS) >= 99) & (np.arange(ROWS) <= 160), 20.0, moving().voltage_V)
LEVELS_V = np.random.default_rng(4).uniform(0.0, 40.0, 20)
BURSTS_s = np.concatenate([k + np.arange(12.0) / 1e3 for k in range(20)])
SPARSE_s = np.concatenate([[0.0], np.cumsum(np.tile([1.0] * 59 + [30.0] * 6, 12))[:-1]])
UNEVEN_s = np.cumsum(np.random.default_rng(2).exponential(0.01, ROWS))


@pytest.mark.parametrize(
    "record",
    [
        moving(),
        commanded(STEPS_V, np.array([37])),
        commanded(STOOD_V, np.arange(100, 160)),
        Record(UNEVEN_s, np.arange(float(ROWS)), np.zeros(ROWS)),
        Record(BURSTS_s, np.repeat(LEVELS_V, 12), np.zeros(240)),
        Record(SPARSE_s, np.repeat(LEVELS_V[:12], 65), np.zeros(780)),
    ],
    ids=["whole", "held meanwhile", "stood through a pause", "uneven clock", "bursts", "sparse at rest"],
)
def test_a_record_that_lacks_nothing_that_counts_is_the_same_one(record: Record) -> None:
    assert completed(record) is record


def waves() -> np.ndarray:
    phases = np.random.default_rng(5).uniform(0.0, 6.3, (12, 1))
    return np.sin(2.0 * np.pi * np.linspace(0.005, 0.1, 12)[:, None] * np.arange(2000) + phases).sum(axis=0)


def sine(rows_a_turn: float) -> np.ndarray:
    return 20.0 * np.sin(2.0 * np.pi * np.arange(ROWS) / rows_a_turn)


def noisy_staircase() -> np.ndarray:
    """Levels of 25 rows, read back with noise."""
    rng = np.random.default_rng(6)
    return np.repeat(rng.uniform(0.0, 40.0, 80), 25) + 1e-3 * rng.standard_normal(2000)


SINGLE = np.random.default_rng(5).choice(np.arange(10, 1990), 100, replace=False)
ONE_AT_A_STEP = np.concatenate([[500], 25 * np.arange(1, 70) + 12])


@pytest.mark.parametrize(
    ("record", "put_in", "first", "left_out"),
    [
        # a held command has changed meanwhile
        (commanded(STEPS_V, np.array([40])), 0, 40, 8),
        (commanded(STEPS_V, np.arange(30, 50)), 0, 30, 20),
        # too long to be bridged, and the command has moved
        (without(moving(), np.arange(100, 101 + MOST_AT_ONCE)), 0, 100, 33),
        (without(moving(), np.arange(100, 320)), 0, 100, 18),
        # the command is foretold across the gap, or is not
        (commanded(sine(100.0), np.arange(100, 104)), 4, 104, 0),
        (commanded(sine(5.0), np.arange(100, 104)), 4, 104, 8),
        # a cubic meets a sine of 40 rows a turn across 8 rows, a straight line across 9 does not
        (commanded(sine(40.0), np.arange(100, 108)), 8, 108, 0),
        (commanded(sine(40.0), np.arange(100, 109)), 9, 109, 9),
        # single rows of what is well foretold; of a staircase, only the one at a step counts
        (commanded(waves(), SINGLE), 100, 0, 0),
        (commanded(noisy_staircase(), ONE_AT_A_STEP), 70, 501, 8),
    ],
)
def test_readings_behind_a_gap_are_left_out_where_the_command_in_it_is_not_foretold(
    record: Record, put_in: int, first: int, left_out: int
) -> None:
    found = completed(record)
    made_up = np.zeros(len(found), dtype=bool) if found.made_up is None else found.made_up
    assert made_up.sum() == put_in
    assert found.behind_pauses == left_out
    lost = np.flatnonzero(np.isnan(found.displacement_um) & ~made_up)
    assert lost.tolist() == list(range(first, first + left_out))
    assert completed(found) is found


def test_a_plant_that_is_driven_with_a_record_answers_the_missing_rows_too(lag: Callable[[], Any]) -> None:
    whole, rows = moving(), np.array([10, 11, 12, 260])
    found, expected = replay(lag(), without(whole, rows)), replay(lag(), whole)
    assert found.simulated_um == pytest.approx(np.delete(expected.simulated_um, rows), abs=1e-9)
    assert found.acting_V == pytest.approx(np.delete(expected.acting_V, rows), abs=1e-9)


def test_no_more_than_a_quarter_of_the_readings_is_left_out() -> None:
    rng = np.random.default_rng(7)
    lost = rng.choice(np.arange(2, 1998), 150, replace=False)
    record = without(Record(np.arange(2000.0) / 1e3, rng.uniform(0.0, 40.0, 2000), np.zeros(2000)), lost)
    assert completed(record).behind_pauses == 0
    short = completed(without(moving(), np.arange(100, 140)))
    assert short.behind_pauses == 36
    assert without_remembered(short, 0.0) is short
    longer = without_remembered(short, 0.375)
    assert longer.behind_pauses == 38
    assert np.flatnonzero(np.isnan(longer.displacement_um)).tolist() == list(range(100, 138))
    assert without_remembered(short, 1e3).behind_pauses <= 0.1 * len(short) + 40
