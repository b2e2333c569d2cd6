"""Rows that a logger has lost are put in where the command cannot have been held meanwhile."""

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


def test_a_record_that_lacks_nothing_is_the_same_one() -> None:
    assert completed(whole := moving()) is whole
    assert completed(found := completed(without(whole, np.array([7, 50])))) is found


def test_a_command_that_is_held_was_held_meanwhile() -> None:
    whole = moving()
    record = without(Record(whole.time_s, np.repeat(np.arange(10.0), 40), whole.displacement_um), np.array([37]))
    assert completed(record) is record


@pytest.mark.parametrize("missing", [1, 20])
def test_behind_a_pause_in_which_a_held_command_has_changed_readings_are_left_out(missing: int) -> None:
    whole = moving()
    first = 40 - missing // 2
    record = without(
        Record(whole.time_s, np.repeat(np.arange(10.0), 40), whole.displacement_um), first + np.arange(missing)
    )
    found = completed(record)
    assert found.made_up is None
    assert found.behind_pauses == max(missing, 8)
    assert np.flatnonzero(np.isnan(found.displacement_um)).tolist() == list(range(first, first + max(missing, 8)))


@pytest.mark.parametrize(("rows_a_turn", "left_out"), [(5.0, 8), (100.0, 0)])
def test_readings_behind_a_pause_count_where_the_command_is_foretold_across_it(
    rows_a_turn: float, left_out: int
) -> None:
    whole = moving()
    volts = np.asarray(20.0 * np.sin(2.0 * np.pi * np.arange(ROWS) / rows_a_turn), dtype=np.float64)
    found = completed(without(Record(whole.time_s, volts, whole.displacement_um), np.arange(100, 104)))
    assert found.made_up is not None
    assert found.made_up.sum() == 4
    assert found.behind_pauses == left_out


@pytest.mark.parametrize("missing", [MOST_AT_ONCE + 1, 220])
def test_behind_a_long_pause_readings_are_left_out_where_the_command_has_moved(missing: int) -> None:
    record = without(moving(), np.arange(100, 100 + missing))
    found = completed(record)
    assert len(found) == len(record)
    assert found.behind_pauses == min(missing, int(0.1 * len(record)))
    assert np.flatnonzero(np.isnan(found.displacement_um)).tolist() == list(range(100, 100 + found.behind_pauses))
    assert completed(found) is found


def test_a_device_that_stood_through_a_pause_is_known_behind_it() -> None:
    whole = moving()
    volts = np.where((np.arange(ROWS) >= 99) & (np.arange(ROWS) <= 160), 20.0, whole.voltage_V)
    record = without(Record(whole.time_s, volts, whole.displacement_um), np.arange(100, 160))
    assert completed(record) is record


def test_a_clock_that_is_not_even_stays_as_it_is() -> None:
    rng = np.random.default_rng(2)
    uneven = Record(np.cumsum(rng.exponential(0.01, ROWS)), np.arange(float(ROWS)), np.zeros(ROWS))
    assert completed(uneven) is uneven


def test_a_plant_that_is_driven_with_a_record_answers_the_missing_rows_too() -> None:
    class Sum:
        """Adds up what is commanded."""

        total = 0.0

        def reset(self) -> None:
            self.total = 0.0

        def read(self) -> float:
            return self.total

        def step(self, voltage_V: float, step_s: float) -> float:
            self.total += voltage_V * step_s
            return self.total

        def close(self) -> None:
            """Nothing is open."""

    whole = moving()
    kept = np.delete(np.arange(ROWS), [10, 11, 12, 260])
    lost = Record(whole.time_s[kept], whole.voltage_V[kept], whole.displacement_um[kept])
    found, expected = replay(Sum(), lost), replay(Sum(), whole)
    assert found.simulated_um == pytest.approx(expected.simulated_um[kept], abs=1e-9)
    assert found.acting_V == pytest.approx(expected.acting_V[kept], abs=1e-9)


def test_a_logger_that_takes_rows_when_something_happens_lacks_none() -> None:
    rng = np.random.default_rng(4)
    levels = rng.uniform(0.0, 40.0, 20)
    bursts_s = np.concatenate([k + np.arange(12.0) / 1e3 for k in range(20)])
    bursts = Record(bursts_s, np.repeat(levels, 12), rng.standard_normal(240))
    assert completed(bursts) is bursts
    steps_s = np.concatenate([[0.0], np.cumsum(np.tile([1.0] * 59 + [30.0] * 6, 12))[:-1]])
    sparse_at_rest = Record(steps_s, np.repeat(levels[:12], 65), rng.standard_normal(780))
    assert completed(sparse_at_rest) is sparse_at_rest


def test_single_rows_lost_of_what_is_well_foretold_take_no_readings_with_them() -> None:
    rng = np.random.default_rng(5)
    rows = np.arange(2000)
    phases = rng.uniform(0.0, 6.3, 12)
    waves = [np.sin(2.0 * np.pi * f * rows + p) for f, p in zip(np.linspace(0.005, 0.1, 12), phases, strict=True)]
    lost = rng.choice(np.arange(10, 1990), 100, replace=False)
    found = completed(without(Record(np.arange(2000.0) / 1e3, np.sum(waves, axis=0), np.zeros(2000)), lost))
    assert found.made_up is not None
    assert found.made_up.sum() == 100
    assert found.behind_pauses == 0


def test_a_staircase_whose_command_is_read_back_with_noise_is_known_but_at_its_steps() -> None:
    rng = np.random.default_rng(6)
    volts = np.repeat(rng.uniform(0.0, 40.0, 80), 25) + 1e-3 * rng.standard_normal(2000)
    lost = np.concatenate([[500], 25 * np.arange(1, 70) + 12])
    found = completed(without(Record(np.arange(2000.0) / 1e3, volts, np.zeros(2000)), lost))
    assert found.pauses == (501,)
    assert found.behind_pauses == 8


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


@pytest.mark.parametrize(("missing", "left_out"), [(8, 0), (9, 9)])
def test_a_gap_is_judged_by_the_course_that_bridges_it(missing: int, left_out: int) -> None:
    """A cubic meets a sine of 40 rows a turn across 8 rows, a straight line across 9 does not."""
    volts = np.asarray(20.0 * np.sin(2.0 * np.pi * np.arange(ROWS) / 40.0), dtype=np.float64)
    whole = moving()
    found = completed(without(Record(whole.time_s, volts, whole.displacement_um), np.arange(100, 100 + missing)))
    assert found.made_up is not None
    assert found.made_up.sum() == missing
    assert found.behind_pauses == left_out
