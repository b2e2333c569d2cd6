"""Outlying readings: what stands alone is one, what follows a jump of the command is judged among its like."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import levels, record_of

from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.record_search import search_records
from bender_inference.records.digits import lattice_step_um
from bender_inference.records.excerpt import Excerpt
from bender_inference.records.observations import Observations, observe
from bender_loop.records.outliers import (
    AFTER_A_JUMP_ROWS,
    FAR,
    heights_after_jumps_V,
    late_stamps_um,
    neighbourhood_um,
    outlying,
)
from bender_loop.records.record import Record
from bender_plant.model import load_model

NOISE_um = 0.1


def observed(voltage_V: np.ndarray, residual: np.ndarray) -> Observations:
    return observe(Record(np.arange(voltage_V.size) / 30.0, voltage_V, residual))


def after_jumps(voltage_V: np.ndarray) -> np.ndarray:
    return np.any([heights > 0.0 for heights in heights_after_jumps_V(voltage_V)], axis=0)


def ramp(rows: int) -> np.ndarray:
    return 0.01 * np.arange(rows, dtype=float)


def test_heights_after_jumps_follow_each_jump_for_three_rows():
    volts = np.array([0.0] * 5 + [10.0] * 6 + [4.0] * 5)
    heights = list(heights_after_jumps_V(volts))
    assert len(heights) == AFTER_A_JUMP_ROWS + 1 == 4
    for lag, found in enumerate(heights):
        expected = np.zeros(16)
        expected[5 + lag], expected[11 + lag] = 10.0, 6.0
        np.testing.assert_array_equal(found, expected)
    near = np.flatnonzero(after_jumps(volts))
    assert list(near) == [5, 6, 7, 8, 11, 12, 13, 14]


def test_a_first_command_is_a_jump_from_nought():
    assert list(np.flatnonzero(after_jumps(np.array([7.0] * 10)))) == [0, 1, 2, 3]


def test_what_moves_all_the_time_has_no_jumps_and_nor_has_what_stands():
    assert not after_jumps(ramp(100)).any()
    assert not after_jumps(np.zeros(100)).any()
    wave = 10.0 * np.sin(np.arange(400) / 20.0)
    assert not after_jumps(wave).any()


@pytest.mark.parametrize(("height", "seen"), [(1.9, False), (2.1, True)])
def test_a_jump_is_a_fiftieth_of_the_span(height: float, seen: bool):
    volts = np.zeros(300)
    volts[100:], volts[200:] = 100.0, 100.0 - height
    assert after_jumps(volts)[200] == seen


@pytest.mark.parametrize(("change", "seen"), [(0.49, False), (0.51, True)])
def test_a_jump_is_five_usual_changes(change: float, seen: bool):
    volts = 0.1 * np.arange(60, dtype=float)
    volts[40:] += change - 0.1
    assert after_jumps(volts)[40] == seen


def test_rows_that_are_left_out_between_others_are_no_jumps_of_the_command():
    """Of a ramp and a few steps, some stretches are read: the first rows behind the steps are late, and no strays."""
    rng = np.random.default_rng(4)
    stairs = np.repeat(10.0 * np.array([0, 1, 2, 3, 4, 5, 4, 3, 2, 1, 0], dtype=float), 200)
    volts = np.concatenate([stairs, 0.25 * np.abs(np.arange(8000) % 400 - 200.0)])
    residual = NOISE_um * rng.standard_normal(volts.size)
    late = np.flatnonzero(np.diff(volts[:2200])) + 2
    residual[late] = 30.0 * NOISE_um
    whole = observed(volts, residual)
    stretches = 25 * np.arange(volts.size // 25)
    behind = np.isin(stretches, 25 * (late // 25))
    chosen = stretches[behind | (stretches > 2200) & (stretches // 25 % 2 == 0)]
    rows = (chosen[:, None] + np.arange(25)).ravel()
    seen = Excerpt(whole, rows).seen()
    assert not outlying(seen, residual[rows], NOISE_um)[np.isin(rows, late)].any()


def test_only_usable_rows_are_neighbours():
    residual = np.array([0.0, 99.0, 1.0, 2.0, 3.0, 99.0, 4.0, 5.0, 6.0])
    rows = np.array([0, 2, 3, 4, 6, 7, 8])
    middle, _ = neighbourhood_um(residual, rows)
    assert middle[3] == pytest.approx(3.0)


@given(st.integers(0, 500), st.integers(10, 589), st.sampled_from([-1.0, 1.0]))
def test_a_reading_far_from_its_neighbours_is_outlying(seed: int, row: int, sign: float):
    rng = np.random.default_rng(seed)
    residual = NOISE_um * rng.standard_normal(600)
    residual[row] += sign * 20.0 * NOISE_um
    assert list(np.flatnonzero(outlying(observed(ramp(600), residual), residual, NOISE_um))) == [row]


@given(st.integers(0, 300))
def test_noise_alone_has_none(seed: int):
    residual = NOISE_um * np.random.default_rng(seed).standard_normal(600)
    assert not outlying(observed(ramp(600), residual), residual, NOISE_um).any()


@pytest.mark.parametrize(("height", "found"), [(5.0, False), (8.5, True)])
def test_far_is_six_deviations(height: float, found: bool):
    residual = np.zeros(200)
    residual[100] = height * NOISE_um
    assert outlying(observed(ramp(200), residual), residual, NOISE_um)[100] == found
    assert FAR == 6.0


def test_the_bulk_counts_where_it_is_wider_than_the_noise_that_was_told():
    rng = np.random.default_rng(3)
    residual = rng.standard_normal(600)
    residual[300] = 5.0
    assert not outlying(observed(ramp(600), residual), residual, 1e-3).any()
    residual[300] = 30.0
    assert list(np.flatnonzero(outlying(observed(ramp(600), residual), residual, 1e-3))) == [300]


def test_structure_that_is_not_alone_is_signal():
    residual = np.zeros(200)
    residual[100:104] = 3.0
    assert not outlying(observed(ramp(200), residual), residual, NOISE_um).any()
    slope = np.concatenate([np.zeros(100), np.linspace(0.0, 50.0, 10), np.full(90, 50.0)])
    assert not outlying(observed(ramp(200), slope), slope, NOISE_um).any()


def test_few_readings_have_none():
    residual = np.zeros(7)
    residual[3] = 1e3
    assert not outlying(observed(ramp(7), residual), residual, NOISE_um).any()
    eight = np.zeros(8)
    eight[4] = 1e3
    assert list(np.flatnonzero(outlying(observed(ramp(8), eight), eight, NOISE_um))) == [4]


def test_a_step_more_of_a_coarse_reading_is_no_wonder():
    from dataclasses import replace

    residual = np.zeros(200)
    residual[100] = 1.5
    seen = observed(ramp(200), residual)
    assert outlying(seen, residual, NOISE_um)[100]
    assert not outlying(replace(seen, half_step_um=1.0), residual, NOISE_um)[100]
    assert outlying(replace(seen, half_step_um=0.5), residual, NOISE_um)[100]


def jumping(count: int, rows: int = 12) -> np.ndarray:
    return np.repeat(np.resize([0.0, 20.0], count), rows)


def test_ringing_after_jumps_is_signal_and_an_exception_among_it_is_not():
    volts = jumping(40)
    rng = np.random.default_rng(4)
    residual = NOISE_um * rng.standard_normal(volts.size)
    jumps = np.flatnonzero(np.diff(volts)) + 1
    residual[jumps] += 1.0 * np.sign(np.diff(volts)[jumps - 1]) + 0.2 * rng.standard_normal(jumps.size)
    assert not outlying(observed(volts, residual), residual, NOISE_um).any()
    residual[jumps[20]] = 15.0
    assert list(np.flatnonzero(outlying(observed(volts, residual), residual, NOISE_um))) == [jumps[20]]


@pytest.mark.parametrize("late", [0, 6])
def test_ringing_after_a_delay_is_signal_too(late: int):
    """A delay brings the jump to the reading later than it is commanded; the lag behind it is not known yet."""
    volts = jumping(40)
    rng = np.random.default_rng(4)
    simulated = np.concatenate([np.zeros(late), volts])[: volts.size]
    residual = NOISE_um * rng.standard_normal(volts.size)
    jumps = np.flatnonzero(np.diff(simulated)) + 1
    residual[jumps] -= np.sign(np.diff(simulated)[jumps - 1]) * (6.0 + 0.2 * rng.standard_normal(jumps.size))
    assert not outlying(observed(volts, simulated + residual), residual, NOISE_um).any()
    residual[jumps[20]] = 200.0
    assert list(np.flatnonzero(outlying(observed(volts, simulated + residual), residual, NOISE_um))) == [jumps[20]]


def test_many_exceptions_are_none():
    volts = jumping(40)
    residual = np.full(volts.size, 1e-3) * np.resize([1.0, -1.0], volts.size)
    jumps = np.flatnonzero(np.diff(volts)) + 1
    residual[jumps[:10]] = 30.0
    assert not outlying(observed(volts, volts + residual), residual, 1e-3).any()
    residual[jumps[:10]] = 1e-3
    residual[jumps[:5]] = 30.0
    assert list(np.flatnonzero(outlying(observed(volts, volts + residual), residual, 1e-3))) == list(jumps[:5])


def test_ringing_grows_with_the_jump():
    rng = np.random.default_rng(6)
    levels = rng.choice([5.0, 40.0], 60) * np.resize([1.0, 0.0], 60)
    volts = np.repeat(levels, 12)
    changes = np.diff(volts)
    jumps = np.flatnonzero(changes) + 1
    residual = NOISE_um * rng.standard_normal(volts.size)
    residual[jumps] += 0.1 * np.abs(changes[jumps - 1]) * rng.standard_normal(jumps.size)
    assert not outlying(observed(volts, residual), residual, NOISE_um)[jumps].any()
    small = jumps[np.abs(changes[jumps - 1]) == 5.0][3]
    residual[small] = 12.0
    assert outlying(observed(volts, residual), residual, NOISE_um)[small]


def alternating(volts: np.ndarray, height_um: float, exception_um: float) -> tuple[np.ndarray, int]:
    """Residual of one size after every jump, its sign in turns, and one exception; the row of the exception."""
    residual = np.zeros(volts.size)
    jumps = np.flatnonzero(np.diff(volts)) + 1
    residual[jumps] = height_um * np.resize([1.0, -1.0], jumps.size)
    residual[jumps[4]] = exception_um
    return residual, int(jumps[4])


@pytest.mark.parametrize(("count", "judged"), [(9, True), (8, False)])
@pytest.mark.parametrize("height_V", [0.5, 20.0])
def test_eight_jumps_of_any_height_judge(count: int, judged: bool, height_V: float):
    volts = jumping(count) * height_V / 20.0
    residual, row = alternating(volts, 0.1, 0.95)
    # the device goes 1 µm for a volt
    assert outlying(observed(volts, volts + residual), residual, 0.01)[row] == judged


@pytest.mark.parametrize(("exception_um", "found"), [(1.02, True), (0.78, False)])
def test_the_noise_counts_once_in_what_a_jump_may_leave(exception_um: float, found: bool):
    # deviation of +-0.1 by the median: 0.148; six of them, the noise of 0.14 within: 0.89
    volts = jumping(41)
    residual, row = alternating(volts, 0.1, exception_um)
    assert outlying(observed(volts, residual), residual, 0.14)[row] == found


@given(values=st.lists(st.floats(-100.0, 100.0), min_size=8, max_size=24, unique=True))
def test_a_neighbourhood_by_hand_for_any_signs(values: list[float]):
    residual = np.array(values)
    middle, spread = neighbourhood_um(residual, np.arange(residual.size))
    for k in range(3, residual.size - 3):
        around = sorted([*values[k - 3 : k], *values[k + 1 : k + 4]])
        centre = 0.5 * (around[2] + around[3])
        near = sorted(around, key=lambda x: abs(x - centre))
        assert middle[k] == pytest.approx(centre)
        if abs(abs(near[3] - centre) - abs(near[4] - centre)) > 1e-9:
            assert spread[k] == pytest.approx(max(near[:4]) - min(near[:4]))


def _stamped_late(rng: np.random.Generator) -> tuple[Observations, np.ndarray]:
    """A staircase whose rows are stamped late on one side: the residual is the way times the delay."""
    reading_um = 20.0 * np.repeat(rng.uniform(-1.0, 1.0, 60), 10)
    way_um = np.abs(np.diff(reading_um, prepend=reading_um[0]))
    late = np.minimum(rng.exponential(1.0, way_um.size), 4.0) - 1.0
    residual = 0.01 * way_um * late + rng.normal(0.0, 0.01, way_um.size)
    return observed_with(ramp(way_um.size), reading_um + residual), residual


def observed_with(voltage_V: np.ndarray, measured_um: np.ndarray) -> Observations:
    return observe(Record(np.arange(voltage_V.size) / 30.0, voltage_V, measured_um))


@pytest.mark.parametrize("seed", range(5))
def test_late_stamps_are_told_from_a_misread_frame_where_that_is_asked(seed: int):
    seen, residual = _stamped_late(np.random.default_rng(seed))
    assert outlying(seen, residual, 0.01).any()
    assert not outlying(seen, residual, 0.01, without_late=True).any()
    row = 300  # at a step
    off = residual.copy()
    off[row] += 15.0
    misread = observed_with(ramp(off.size), seen.measured_um - residual + off)
    assert list(np.flatnonzero(outlying(misread, off, 0.01, without_late=True))) == [row]


def test_what_late_stamps_do_is_not_guessed_from_few_moving_rows():
    residual = np.array([0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    reading = np.array([0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert not late_stamps_um(reading, residual, 0.1).any()


CAMERA_NOISE_um = 0.06


def misread(record: Record, rows: list[int], by_um: float = 4.0) -> Record:
    readings = np.array(record.displacement_um)
    readings[rows] += by_um
    return Record(record.time_s, record.voltage_V, readings)


@examples(max_examples=25)
@given(st.integers(0, 1000), st.integers(0, 597))
@example(1, 0)
@example(1, 597)
def test_two_that_nearly_touch_are_both_found(seed: int, row: int) -> None:
    """Away from jumps of the command, white noise with two misread frames one row apart."""
    rng = np.random.default_rng(seed)
    residual = CAMERA_NOISE_um * rng.standard_normal(600)
    residual[[row, row + 2]] += [3.0, -5.0]
    still = observe(Record(np.arange(600) / 30.0, 0.01 * np.arange(600.0), residual))
    assert list(np.flatnonzero(outlying(still, residual, CAMERA_NOISE_um))) == [row, row + 2]


@pytest.mark.parametrize("step_um", [0.4, 1.3])
def test_a_lattice_is_seen_although_some_readings_are_off_it(step_um: float) -> None:
    rng = np.random.default_rng(3)
    readings = step_um * np.round(rng.uniform(0.0, 40.0, 2000) / step_um)
    readings[rng.choice(2000, 20, replace=False)] += rng.uniform(1.5, 20.0, 20)
    assert lattice_step_um(readings) == pytest.approx(step_um, rel=1e-6)
    assert lattice_step_um(rng.normal(size=2000)) == 0.0


@pytest.mark.parametrize(
    ("levels", "step_um"),
    [
        # a level that was misread four times, a sixth as far from rest as the other one, nearly
        ((-0.31278107615284784, 0.0, 0.052099375707068296), 0.0),
        ((-0.3126, 0.0, 0.0521), 0.0521),
        ((-0.31, 0.0, 0.05, 0.11, 0.2), 0.0),
        ((0.017, 0.267, 0.517, 1.267), 0.25),
    ],
)
def test_a_few_levels_are_a_lattice_where_that_is_no_chance(levels: tuple[float, ...], step_um: float) -> None:
    readings = np.repeat(levels, 40)
    assert lattice_step_um(readings) == pytest.approx(step_um, rel=1e-6)


@pytest.mark.slow
def test_an_effect_is_found_through_misread_and_lost_frames() -> None:
    record = record_of(effects={"charge_leakage": {"fraction": 0.2, "time_constant_s": 5.0}}, voltage_V=levels(40.0))
    rng = np.random.default_rng(5)
    rows = rng.choice(np.arange(20, 1200), 36, replace=False)
    wrong = misread(record, sorted(int(x) for x in rows[:12]), 2.5)
    readings = np.array(wrong.displacement_um)
    readings[rows[12:]] = np.nan
    found = search_records(load_model("paper"), [Record(record.time_s, record.voltage_V, readings)])
    assert found.verdict.word == "named"
    assert found.best.hypothesis.effects == ("charge_leakage",)
    aside = set(np.flatnonzero(np.isfinite(readings) & ~found.problem.observations[0].usable))
    assert aside == set(rows[:12])


@pytest.mark.parametrize("seed", [0, *(pytest.param(x, marks=pytest.mark.slow) for x in (1, 2))])
def test_what_noise_does_at_the_edges_of_steps_has_no_name(seed: int) -> None:
    """Readings in steps far above the noise: nothing is missing but the steps."""
    fine = record_of(voltage_V=levels(40.0, seed), seed=seed)
    coarse = Record(fine.time_s, fine.voltage_V, 1.3 * np.round(fine.displacement_um / 1.3))
    assert [x.id for x in find(search_records(load_model("paper"), [coarse])).added] == ["sensor_quantisation"]


def test_a_stray_after_a_jump_that_no_ringing_reaches_is_outlying() -> None:
    """A sine of few rows a volt begins with steps that count as jumps: 0.02 V high, not 50 times the stroke."""
    rng = np.random.default_rng(8)
    volts = 0.2 - 0.2 * np.cos(2.0 * np.pi * np.arange(400) / 400.0)
    volts[:6] = [0.015, 0.035, 0.052, 0.066, 0.081, 0.099]
    residual = 1e-3 * rng.standard_normal(volts.size)
    stray, ringing = residual.copy(), residual.copy()
    stray[1] += 0.97
    ringing[1] += 0.02
    for x, expected in ((stray, [1]), (ringing, [])):
        assert list(np.flatnonzero(outlying(observed(volts, volts + x), x, 1e-3))) == expected


def test_under_a_command_that_stands_above_nought_strays_are_found_and_nothing_fails() -> None:
    rng = np.random.default_rng(12)
    residual = 1e-3 * rng.standard_normal(60)
    residual[[0, 30]] += 5.0
    volts = np.full(60, 7.0)
    assert list(np.flatnonzero(outlying(observed(volts, volts + residual), residual, 1e-3))) == [0, 30]


def test_a_jump_whose_own_row_is_lost_is_a_jump_still() -> None:
    """Small volts, large readings: three rows after the jump the tip rings by a seventh of its stroke."""
    rng = np.random.default_rng(13)
    volts = np.where(np.arange(100) < 50, 0.0, 0.04)
    residual = 1e-3 * rng.standard_normal(100)
    residual[51] += 3.0
    readings = 500.0 * volts + residual
    readings[50] = np.nan
    assert not outlying(observed(volts, readings), residual, 1e-3).any()
