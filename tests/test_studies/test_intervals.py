"""Stated intervals: what covers, what is told, and that what is hidden has one true number."""

import math
from pathlib import Path

import pytest

from bender_studies.hidden_effects.intervals import DEVIATIONS, KNOWN, Told, bench_of, intervals, misses, totals


def told(found: float, deviation: float, effect: str = "dead_zone", truth: float = 2.0, rate_Hz: float = 0.0) -> Told:
    return Told(1, "case", effect, truth, rate_Hz, "named", found, deviation)


def test_an_interval_of_95_percent_is_1_96_deviations_wide() -> None:
    assert pytest.approx(1.96, abs=1e-3) == DEVIATIONS
    assert told(2.19, 0.1).covers
    assert not told(2.20, 0.1).covers
    assert not told(math.nan, 0.1).is_told
    assert not told(2.0, math.inf).covers


def test_a_step_that_all_readings_lie_on_is_exact_or_wrong() -> None:
    assert told(2.0 + 1e-12, 0.0).covers
    assert not told(2.0 + 1e-6, 0.0).covers


def test_a_frequency_counts_as_its_image_in_even_rows() -> None:
    assert told(97.0, 0.1, "periodic_disturbance", truth=7.0, rate_Hz=30.0).covers
    assert told(23.0, 0.1, "periodic_disturbance", truth=7.0, rate_Hz=30.0).covers
    assert not told(97.0, 0.1, "periodic_disturbance", truth=7.0).covers


def test_only_told_numbers_are_shared_out() -> None:
    rows = totals([told(2.0, 0.1), told(3.0, 0.1), told(math.nan, math.nan)])
    assert [x[:5] for x in rows] == [["dead_zone", "3", "2", "1", "50.0 %"], ["all", "3", "2", "1", "50.0 %"]]
    assert [x[3] for x in misses([told(2.0, 0.1), told(3.0, 0.1), told(math.nan, math.nan)])] == ["3", "nan"]


@pytest.mark.parametrize("number", range(len(KNOWN)))
def test_what_is_hidden_has_the_number_that_is_asked_for(number: int) -> None:
    case = bench_of(number, 1)
    (hidden,) = case.effects
    known = KNOWN[hidden.id]
    assert hidden.id in known.asked
    assert hidden.form == known.form
    assert any(math.isclose(x, known.truth(hidden)) for _, x in hidden.parameters)
    assert case == bench_of(number, 1)


def test_a_bench_is_recorded_diagnosed_and_judged(tmp_path: Path) -> None:
    place = tuple(KNOWN).index("source_resistance")
    (found,) = intervals([place], 1, tmp_path, 1)
    assert found.verdict == "named"
    assert found.found == pytest.approx(found.truth, rel=0.02)
    assert 0.0 < found.deviation < 0.01 * found.truth
    assert list(tmp_path.iterdir()) == []
