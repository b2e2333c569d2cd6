"""The noise floor is that of the noise, whatever part of the readings was lost."""

from dataclasses import replace

import numpy as np
import pytest
from few import few
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_inference.fitting.fit_problem import problem_of
from bender_inference.records.noise import (
    LOG_FLOOR_RATIO,
    QUIET_MEDIAN,
    end_of_rests,
    from_differences,
    from_quiet_spectra,
    from_rests,
    from_spectrum,
    from_stretches,
    noise_floor_um,
    quiet_medians,
)
from bender_inference.records.observations import observe
from bender_inference.records.spectrum import are_even, bin_s, without_line
from bender_inference.search.noise import floor_square_um2
from bender_loop.records.outliers import deviation
from bender_loop.records.record import Record
from bender_plant.model import load_model


def lost_at_random(share: float, rng: np.random.Generator) -> np.ndarray:
    return rng.random(4000) >= share


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.9])
def test_lost_readings_do_not_lower_the_floor(share: float):
    rng = np.random.default_rng(5)
    noise_um = 0.06 * rng.standard_normal(4000)
    usable = lost_at_random(share, rng)
    assert from_spectrum(noise_um, usable) == pytest.approx(0.06, rel=0.15)
    assert noise_floor_um(np.where(usable, noise_um, 0.0), usable) == pytest.approx(0.06, rel=0.2)


def test_readings_of_the_beginning_alone_have_the_floor_of_their_noise():
    noise_um = 0.06 * np.random.default_rng(6).standard_normal(4000)
    usable = np.arange(4000) < 400
    assert noise_floor_um(np.where(usable, noise_um, 0.0), usable) == pytest.approx(0.06, rel=0.25)


def test_smooth_structure_hardly_raises_it_and_scale_scales_it():
    rng = np.random.default_rng(7)
    rows, usable = np.arange(4000), lost_at_random(0.3, rng)
    left_um = 0.06 * rng.standard_normal(4000) + 2.0 * np.sin(rows / 300.0)
    floor_um = noise_floor_um(left_um, usable)
    assert floor_um == pytest.approx(0.06, rel=0.2)
    assert noise_floor_um(1000.0 * left_um, usable) == pytest.approx(1000.0 * floor_um, rel=1e-9)


def test_too_few_rows_are_refused():
    with pytest.raises(ValueError, match="fewer than 16 rows"):
        noise_floor_um(np.zeros(40), np.arange(40) < 12)


def test_each_estimate_is_that_of_white_noise():
    values = 0.3 * np.random.default_rng(8).standard_normal(40_000)
    everything = np.ones(values.size, dtype=bool)
    for estimate in (from_differences, from_spectrum, from_stretches):
        assert estimate(values, everything) == pytest.approx(0.3, rel=0.03), estimate.__name__


@given(st.floats(0.0, 1.0), st.lists(st.floats(0.0, 2.0), min_size=1, max_size=3))
def test_no_model_goes_below_the_noise_and_the_mean_of_the_steps_of_the_records(noise_um: float, steps_um: list[float]):
    """Rounding to a step adds the variance of a uniform distribution of its width."""
    time_s = np.arange(60) / 30.0
    seen = observe(Record(time_s, np.round(time_s), time_s))
    records = tuple(replace(seen, half_step_um=0.5 * x) for x in steps_um)
    uniform = np.mean([np.diff((np.array([-x, x]) / 2.0) ** 3)[0] / (3.0 * x) if x else 0.0 for x in steps_um])
    assert floor_square_um2(problem_of(load_model("paper"), records), noise_um) == pytest.approx(noise_um**2 + uniform)


def test_the_deviation_is_that_of_the_bulk():
    values = np.random.default_rng(9).standard_normal(20_001)
    assert deviation(5.0 + 2.0 * values) == pytest.approx(2.0, rel=0.03)
    spoiled = values.copy()
    spoiled[:2000] += 50.0
    assert deviation(spoiled) < 1.4
    assert deviation(np.array([])) == 0.0
    assert deviation(np.array([1.0, 2.0, 4.0])) == pytest.approx(1.4826)


def test_differences_need_four_rows_in_a_row_and_ten_of_them():
    rng = np.random.default_rng(10)
    values = rng.standard_normal(400)
    usable = np.arange(400) % 4 != 3
    assert np.isnan(from_differences(values, usable))
    assert np.isnan(from_differences(values[:12], np.ones(12, dtype=bool)))
    assert np.isfinite(from_differences(values[:13], np.ones(13, dtype=bool)))
    gaps = np.arange(400) % 9 != 3
    spoiled = np.where(gaps, values, 1e6)
    assert from_differences(spoiled, gaps) == from_differences(np.where(gaps, values, -1e6), gaps)


def test_differences_do_not_see_a_parabola():
    rows = np.arange(500, dtype=float)
    assert from_differences(1e-3 * rows**2 + rows, np.ones(500, dtype=bool)) == pytest.approx(0.0, abs=1e-9)


def test_the_spectrum_does_not_see_a_hum_and_needs_sixteen_rows():
    rng = np.random.default_rng(11)
    values, rows = rng.standard_normal(4000), np.arange(4000)
    everything = np.ones(4000, dtype=bool)
    hum = values + 30.0 * np.sin(1.234 * rows)
    assert from_spectrum(hum, everything) == pytest.approx(from_spectrum(values, everything), rel=0.05)
    assert np.isnan(from_spectrum(values[:15], everything[:15]))
    assert np.isfinite(from_spectrum(values[:16], everything[:16]))
    assert from_spectrum(values + 1e3, everything) == pytest.approx(from_spectrum(values, everything), rel=1e-6)


def test_stretches_do_not_see_a_burst_nor_a_parabola_and_need_twenty_four():
    rng = np.random.default_rng(12)
    values = rng.standard_normal(16 * 200)
    everything = np.ones(values.size, dtype=bool)
    burst = values.copy()
    burst[: 16 * 100] *= 40.0
    assert from_stretches(burst, everything) == pytest.approx(1.0, rel=0.2)
    bent = values + 1e-2 * (np.arange(values.size) / 16.0) ** 2
    assert from_stretches(bent, everything) == pytest.approx(from_stretches(values, everything), rel=0.02)
    assert np.isnan(from_stretches(values[: 16 * 24 - 1], everything[: 16 * 24 - 1]))
    assert np.isfinite(from_stretches(values[: 16 * 24 + 5], everything[: 16 * 24 + 5]))
    lost = everything.copy()
    lost[5] = False
    wrong = values.copy()
    wrong[5] = 1e9
    assert from_stretches(wrong, lost) == pytest.approx(1.0, rel=0.2)


@given(frequency=st.floats(0.1, 0.48), size=st.floats(0.0, 20.0), seed=st.integers(0, 1000))
@settings(max_examples=25)
def test_a_hum_beside_steps_that_are_missed_does_not_hide_the_floor(frequency: float, size: float, seed: int):
    """A hum fills every stretch, what follows a step fills every frequency: neither fills both."""
    rng, rows = np.random.default_rng(seed), np.arange(5120)
    after_step = 200.0 * np.exp(-(rows % 128) / 3.0) * (-1.0) ** rows
    values = rng.standard_normal(rows.size) + size * np.sin(2.0 * np.pi * frequency * rows) + after_step
    assert 0.85 < noise_floor_um(values, np.ones(rows.size, dtype=bool)) < 1.4


def test_quiet_spectra_need_twenty_four_stretches_and_readings_that_do_not_stand_still():
    rng = np.random.default_rng(14)
    values = rng.standard_normal(32 * 100)
    everything = np.ones(values.size, dtype=bool)
    assert from_quiet_spectra(values, everything) == pytest.approx(1.0, rel=0.1)
    assert np.isnan(from_quiet_spectra(values[: 32 * 24 - 1], everything[: 32 * 24 - 1]))
    sloping = values + 0.1 * np.arange(values.size)
    assert from_quiet_spectra(sloping, everything) == pytest.approx(from_quiet_spectra(values, everything), rel=1e-6)
    long = rng.standard_normal(32 * 9001)
    assert from_quiet_spectra(long, np.ones(long.size, dtype=bool)) == pytest.approx(1.0, rel=0.02)
    still = np.where(rng.random(values.size) < 0.3, 0.0, values)
    assert np.isnan(from_quiet_spectra(still, everything))


@pytest.mark.parametrize("rows", few([32, 128, 724, 2048], 0))
def test_the_tables_of_white_noise_are_those_of_new_draws(rows: int):
    rng, draws = np.random.default_rng(rows), 500
    usable = np.ones(rows, dtype=bool)
    logs = [-2.0 * np.log(noise_floor_um(rng.standard_normal(rows), usable)) for _ in range(draws)]
    mean, variance = LOG_FLOOR_RATIO[rows]
    assert abs(np.mean(logs) - mean) < 4.0 * np.sqrt(1.25 * variance / draws)
    assert np.var(logs) == pytest.approx(variance, rel=0.3)
    quiet = quiet_medians(rng.standard_normal((20_000, 32)))
    assert np.quantile(quiet, 0.25) == pytest.approx(QUIET_MEDIAN, rel=0.02)


@pytest.mark.parametrize("frequency_Hz", [41.0, 100.0, 175.9])
def test_a_hum_before_a_camera_of_uneven_frames_is_no_noise(frequency_Hz: float):
    rng = np.random.default_rng(13)
    time_s = np.cumsum(1.0 / 30.0 + 0.004 * rng.uniform(-1.0, 1.0, 4000))
    noise_um = 0.06 * rng.standard_normal(time_s.size)
    hum_um = 0.7 * np.sin(2.0 * np.pi * frequency_Hz * time_s + 0.4)
    usable = rng.uniform(size=time_s.size) > 0.1
    # from row to row it looks like noise
    assert noise_floor_um(noise_um + hum_um, usable) > (0.3 if frequency_Hz > 50.0 else 0.06)
    left_um = without_line(time_s, 3.0 + noise_um + hum_um, usable)
    assert noise_floor_um(left_um, usable) == pytest.approx(0.06, rel=0.1)
    assert np.sqrt(np.mean((left_um - 3.0)[usable] ** 2)) == pytest.approx(0.06, rel=0.1)
    assert np.array_equal(left_um[~usable], (3.0 + noise_um + hum_um)[~usable])


def test_white_noise_has_no_line_and_even_rows_show_theirs_anyway():
    rng = np.random.default_rng(14)
    even_s = np.arange(2000) / 30.0
    hum = np.sin(2.0 * np.pi * 7.3 * even_s)
    everything = np.ones(2000, dtype=bool)
    assert without_line(even_s, hum, everything) is hum
    uneven_s = even_s + 0.003 * rng.uniform(-1.0, 1.0, 2000)
    found = [without_line(uneven_s, x, everything) is not x for x in rng.standard_normal((200, 2000))]
    # of 200 draws at 1 %, more than eight come once in five thousand times
    assert sum(found) <= 8
    few = rng.standard_normal(15)
    assert without_line(uneven_s[:15], few, everything[:15]) is few


@given(st.floats(1e-4, 10.0), st.integers(0, 99))
def test_rows_that_are_missing_leave_a_grid_even(step_s: float, seed: int) -> None:
    kept = np.flatnonzero(np.append([True, True, True], np.random.default_rng(seed).random(60) > 0.25))
    time_s = (step_s * kept).astype(np.float64)
    assert are_even(time_s)
    assert bin_s(time_s) == pytest.approx(step_s)
    jittered = time_s + 0.1 * step_s * np.random.default_rng(seed).random(time_s.size)
    assert not are_even(jittered)


@given(rows_a_level=st.integers(6, 12), after_step=st.floats(5.0, 50.0), seed=st.integers(0, 1000))
@settings(max_examples=25)
def test_what_follows_every_step_of_a_staircase_is_no_noise(rows_a_level: int, after_step: float, seed: int):
    rows = np.arange(600)
    since = rows % rows_a_level
    command = (rows // rows_a_level).astype(float)
    left = np.random.default_rng(seed).standard_normal(rows.size) + after_step * (since < rows_a_level // 3)
    usable = np.ones(rows.size, dtype=bool)
    assert noise_floor_um(left, usable, end_of_rests(command)) == pytest.approx(1.0, rel=0.4)


def test_of_white_noise_the_rows_at_rest_hardly_ever_say_less():
    rng, resting = np.random.default_rng(17), end_of_rests((np.arange(600) // 6).astype(float))
    usable = np.ones(600, dtype=bool)
    draws = [rng.standard_normal(600) for _ in range(400)]
    less = [noise_floor_um(x, usable, resting) < noise_floor_um(x, usable) for x in draws]
    # three errors on one side
    assert sum(less) <= 4


@given(st.lists(st.tuples(st.sampled_from([0.0, 1.0, 2.0]), st.integers(1, 9)), min_size=1, max_size=20))
def test_the_end_of_a_rest_follows_rows_of_the_same_command(held: list[tuple[float, int]]):
    command = np.repeat([x for x, _ in held], [n for _, n in held])
    resting = end_of_rests(command)
    assert not resting[0]
    for row in np.flatnonzero(resting):
        assert command[row] == command[row - 1]


def test_a_command_that_never_rests_has_no_rows_at_rest():
    usable, command = np.ones(600, dtype=bool), np.arange(600.0)
    assert not end_of_rests(command).any()
    assert np.isnan(from_rests(np.ones(600), usable, end_of_rests(command))[0])


@pytest.mark.parametrize("rows", [120, 1000])
def test_the_error_of_the_deviation_at_rest_is_that_of_new_draws(rows: int):
    rng, usable, resting = np.random.default_rng(18), np.ones(rows, dtype=bool), np.arange(rows) > 0
    found = [from_rests(rng.standard_normal(rows), usable, resting) for _ in range(1000)]
    deviations, errors = np.array(found).T
    assert np.mean(deviations) == pytest.approx(1.0, abs=0.02)
    assert np.std(deviations) == pytest.approx(errors[0], rel=0.1)
