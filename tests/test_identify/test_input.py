"""Records to learn from: what the input does between the rows, how much it excites, what is cut and shared."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from few import few_rows
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_identify.first_model.course import course_between_rows, experiments_of
from bender_identify.records.excitation import check_answered, cycle_scatter_um, describe
from bender_identify.records.experiment import experiment_of
from bender_identify.records.voltage_path import even_times
from bender_identify.settings import Settings
from bender_loop.errors import InputError
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


@pytest.mark.slow
@settings(max_examples=3)
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


@pytest.mark.parametrize(("asked", "found"), few_rows([("hold", "hold"), ("auto", "linear"), ("smooth", "smooth")], 1))
def test_what_is_asked_for_is_taken(asked, found):
    rng = np.random.default_rng(5)
    drive = rng.uniform(-5.0, 5.0, 300)
    record = recorded(drive, drive, rng)
    assert [x.input_hold for x in experiments_of([record], ["noise.csv"], asked)] == [found]


TIME = even_times(0.01, 2000)
WHITE = np.random.default_rng(2).standard_normal(2000)


@pytest.mark.parametrize("lag", [0, 30])
def test_a_reading_that_follows_passes_in_noise_as_large_as_itself_and_noise_alone_does_not(lag: int) -> None:
    volts = np.sin(TIME)
    check_answered("a.csv", volts, np.roll(volts, lag) + WHITE)
    with pytest.raises(InputError, match=r"explains .* % of displacement_um"):
        check_answered("a.csv", volts, WHITE)


@pytest.mark.parametrize("shape", ["sine", "triangle", "square"])
def test_one_cycle_over_and_over_is_seen(shape: str) -> None:
    phase = TIME / 1.6
    shapes = {
        "sine": np.sin(2 * np.pi * phase),
        "triangle": 2 * np.abs(2 * (phase % 1) - 1) - 1,
        "square": np.where(phase % 1 < 0.5, 1.0, -1.0),
    }
    volts = np.asarray(shapes[shape], dtype=np.float64)
    found = describe(TIME, volts, volts)
    assert found.single
    assert found.period_s == pytest.approx(1.6, rel=0.02)


def test_two_tones_and_a_growing_tone_are_not_one_cycle() -> None:
    for volts in (np.sin(2 * TIME) + np.sin(5.3 * TIME), np.sin(3 * TIME) * TIME, TIME):
        assert not describe(TIME, volts, volts).single


def test_noise_and_scatter_are_measured() -> None:
    cycle = np.sin(2 * np.pi * TIME / 2.0)
    noisy = cycle + 0.1 * WHITE
    assert describe(TIME, cycle, noisy).noise_um == pytest.approx(0.1, rel=0.15)
    assert cycle_scatter_um(TIME, noisy, 2.0) == pytest.approx(0.1, rel=0.15)
    assert cycle_scatter_um(TIME[:300], noisy[:300], 2.0) is None


ROWS_s = even_times(0.05, 400)
SINE = np.sin(np.pi * ROWS_s)
RISING = Record(ROWS_s, SINE, 2.0 * SINE)
SHIFTED = Record(ROWS_s, np.sin(np.pi * ROWS_s + 1.0), 2.0 * np.sin(np.pi * ROWS_s + 1.0))


def test_the_end_of_a_record_is_held_out() -> None:
    made = experiment_of(RISING, "a", Settings(held_out_share=0.25))
    assert not np.any(made.fitted & made.held_out)
    assert np.all(made.fitted | made.held_out)
    assert made.fitted[:300].all()
    assert made.held_out[300:].all()
    assert made.fitting_all().fitted.all()
    assert made.holding_out_all().held_out.all()


def test_the_first_cycle_is_set_aside_where_the_record_starts_with_a_step() -> None:
    made = experiment_of(SHIFTED, "a", Settings())
    counted = made.fitted | made.held_out
    assert not counted[:39].any()
    assert counted[42:].all()
    assert not (experiment_of(SHIFTED, "a", Settings(set_aside_s=5.0)).fitted[:100]).any()


def test_a_record_from_rest_keeps_its_first_reading_and_one_in_motion_does_not() -> None:
    at_rest = SHIFTED.displacement_um.copy()
    at_rest[0] = 0.0
    made = experiment_of(replace(SHIFTED, displacement_um=at_rest), "a", Settings())
    assert not made.in_motion
    assert made.fitted[0]
    moving = experiment_of(SHIFTED, "a", Settings())
    assert moving.in_motion
    assert moving.lead_rows == 399
    assert not moving.fitted[0]


def test_lost_frames_are_not_counted() -> None:
    lost = RISING.displacement_um.copy()
    lost[[5, 200, 399]] = np.nan
    made = experiment_of(replace(RISING, displacement_um=lost), "a", Settings())
    assert np.flatnonzero(~(made.fitted | made.held_out)).tolist() == [5, 200, 399]


def test_too_few_readings_are_refused() -> None:
    with pytest.raises(InputError, match="12 readings in 12 rows, expected at least 20"):
        experiment_of(Record(ROWS_s[:12], SINE[:12], SINE[:12]), "a", Settings())
    with pytest.raises(InputError, match="left after what is set aside"):
        experiment_of(RISING, "a", Settings(set_aside_s=19.5))


def test_an_untimed_record_is_read_after_its_voltage() -> None:
    made = experiment_of(RISING, "a", Settings(), untimed=True)
    assert made.acting_V.tolist() == SINE.tolist()
    assert np.all(made.drive.row_time_s[1:] > made.drive.command_time_s)
    assert np.all(made.drive.row_time_s[1:-1] < made.drive.command_time_s[1:])
    assert not made.timed
