"""Stated intervals: what covers, what is told, and that what is hidden has one true number."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from few import few

from bender_proving import NOISE_UM, Bench
from bender_studies.hidden_effects.exposed_record import exposed_record
from bender_studies.hidden_effects.intervals import (
    DEVIATIONS,
    KNOWN,
    StatedInterval,
    bench_of,
    exposure_of,
    intervals,
    misses,
    numbers_of,
    totals,
)


def told(
    found: float, deviation: float, effect: str = "dead_zone", truth: float = 2.0, rate_Hz: float = 0.0
) -> StatedInterval:
    return StatedInterval(1, "case", effect, truth, rate_Hz, "named", found, deviation)


def hum(found: float, truth: float = 7.0, rate_Hz: float = 30.0, **more: object) -> StatedInterval:
    stated = told(found, 0.1, "periodic_disturbance", truth, rate_Hz)
    return replace(stated, **more)  # pyright: ignore[reportArgumentType]


ONE_SIDED = replace(told(2.0, 0.1), interval=(1.9, 2.6))


@pytest.mark.parametrize(
    ("stated", "covers"),
    [
        pytest.param(told(2.19, 0.1), True, id="1.9 deviations"),
        pytest.param(told(2.20, 0.1), False, id="2 deviations"),
        pytest.param(told(2.0, math.inf), False, id="no deviation"),
        pytest.param(replace(ONE_SIDED, truth=2.5), True, id="further to one side"),
        pytest.param(replace(ONE_SIDED, truth=2.65), False, id="beyond that side"),
        pytest.param(replace(ONE_SIDED, truth=1.85), False, id="beyond the other side"),
        pytest.param(told(2.0 + 1e-12, 0.0), True, id="a step that all readings lie on is exact"),
        pytest.param(told(2.0 + 1e-6, 0.0), False, id="or wrong"),
        pytest.param(hum(97.0), True, id="the image of a frequency in even rows"),
        pytest.param(hum(23.0), True, id="another image"),
        pytest.param(hum(97.0, rate_Hz=0.0), False, id="no image in uneven rows"),
        pytest.param(hum(97.0, interval=(96.9, 97.3)), True, id="an image in a one-sided interval"),
        pytest.param(hum(97.0, 7.2, interval=(96.9, 97.3)), True, id="an image further to one side"),
        pytest.param(hum(97.0, 7.4, interval=(96.9, 97.3)), False, id="an image beyond that side"),
    ],
)
def test_an_interval_covers_what_lies_in_it(stated: StatedInterval, covers: bool) -> None:
    assert stated.covers is covers


def test_an_interval_of_95_percent_is_1_96_deviations_wide() -> None:
    assert pytest.approx(1.96, abs=1e-3) == DEVIATIONS
    assert not told(math.nan, 0.1).has_interval


def test_only_told_numbers_are_shared_out() -> None:
    rows = totals([told(2.0, 0.1), told(3.0, 0.1), told(math.nan, math.nan)])
    assert [x[:5] for x in rows] == [["dead_zone", "3", "2", "1", "50.0 %"], ["all", "3", "2", "1", "50.0 %"]]
    assert [x[3] for x in misses([told(2.0, 0.1), told(3.0, 0.1), told(math.nan, math.nan)])] == ["3", "nan"]


@pytest.mark.parametrize("number", few(range(len(KNOWN)), 0, 4, 8, 12))
def test_what_is_hidden_has_the_number_that_is_asked_for(number: int) -> None:
    case = bench_of(number, 1)
    (hidden,) = case.effects
    known = KNOWN[hidden.id]
    assert hidden.id in known.asked
    assert hidden.form == known.form
    assert any(math.isclose(x, known.truth(hidden)) for _, x in hidden.parameters)
    assert case == bench_of(number, 1)


def test_exposed_benches_have_a_row_of_their_own() -> None:
    rows = totals([told(2.0, 0.1), replace(told(3.0, 0.1), exposure_s=0.01)])
    assert [x[:4] for x in rows] == [
        ["dead_zone", "2", "2", "1"],
        ["exposed", "1", "1", "0"],
        ["all", "2", "2", "1"],
    ]


@pytest.mark.slow
def test_half_of_the_cameras_are_exposed_and_none_that_rounds() -> None:
    benches = [(k, bench_of(k, 1)) for k in range(4 * len(KNOWN))]
    found = {k: exposure_of(case, k, 1) for k, case in benches}
    cameras = [k for k, case in benches if case.sensor == "camera" and case.effect_ids != ("sensor_quantisation",)]
    assert all(found[k] == 0.0 for k, _ in benches if k not in cameras)
    assert 0.3 < sum(found[k] > 0.0 for k in cameras) / len(cameras) < 0.7


@pytest.mark.slow
def test_an_exposed_reading_is_the_mean_of_snapshots_around_its_instant() -> None:
    number = tuple(KNOWN).index("source_resistance")
    case = next(x for x in (bench_of(number + k * len(KNOWN), 1) for k in range(9)) if x.sensor == "camera")
    still, seen = (exposed_record(case, x).displacement_um for x in (1e-6, 0.016))
    moving = np.abs(np.diff(still, append=still[-1])) > 20.0 * NOISE_UM["camera"]
    snapshots = Bench(case).clean(Bench(case).excitation())
    assert np.std(still[~moving] - snapshots[~moving]) < 1.5 * case.gain * NOISE_UM["camera"]
    assert np.max(np.abs(seen - still)[moving]) > 5.0 * NOISE_UM["camera"]
    assert np.median(np.abs(seen - still)[~moving]) < NOISE_UM["camera"]


@pytest.mark.slow
def test_a_bench_is_recorded_diagnosed_and_judged(tmp_path: Path) -> None:
    place = tuple(KNOWN).index("source_resistance")
    (found,) = intervals([place], 1, tmp_path, 1)
    assert found.verdict == "named"
    assert found.found == pytest.approx(found.truth, rel=0.02)
    assert 0.0 < found.deviation < 0.01 * found.truth
    assert list(tmp_path.iterdir()) == []


def test_benches_of_some_effects_are_those_of_all_without_the_others() -> None:
    effects = ["supply_quantisation", "dead_zone"]
    numbers = numbers_of(5, effects)
    assert numbers == sorted(set(numbers))
    every = [k for k in range(len(KNOWN) * 3) if tuple(KNOWN)[k % len(KNOWN)] in effects]
    assert numbers == every[:5]
    assert {bench_of(k, 3).effect_ids[0] for k in numbers} == set(effects)
    assert numbers_of(4, ()) == [0, 1, 2, 3]
