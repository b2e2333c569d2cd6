"""Slow changes: slope, forecast, memory."""

import json
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_watch.trend import MOST_STRETCHES, Trends

GAIN_UNIT, OFFSET_UNIT_UM = 0.01, 0.1
"""That a signature of unit size is."""


def trends_of(course: float | Callable[[np.ndarray], np.ndarray], rows: int, seed: int, part: int = 4096) -> Trends:
    """Return the trends of a gain that is so far away after so many rows, in units, or so much more at every one."""
    rng = np.random.default_rng(seed)
    time, z = np.arange(rows, dtype=float), rng.standard_normal(rows)
    e = rng.standard_normal(rows) + (course(time) if callable(course) else course * time) * z
    found = Trends()
    for a in range(0, rows, part):
        cut = slice(a, a + part)
        found.add(time[cut], e[cut], np.ones(rows)[cut] / OFFSET_UNIT_UM, z[cut] / GAIN_UNIT)
    return found


END = 40_000.0
"""Rows after which 5 % of the gain are gone."""
COURSES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "straight": lambda t: -5.0 * t / END,
    "to an end": lambda t: -8.0 * (1.0 - np.exp(t / END * math.log(3.0 / 8.0))),
    "ever slower": lambda t: -5.0 * np.log1p(t / 1000.0) / math.log1p(END / 1000.0),
    "ever faster": lambda t: -5.0 * (t / END) ** 2,
}


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("part", [0.5, 0.8])
def test_a_forecast_holds_the_truth_whatever_the_course(course: str, part: float) -> None:
    held, seeds, rows = 0, 12, int(part * END)
    for seed in range(seeds):
        gain, offset = trends_of(COURSES[course], rows, seed).trends(0.05, 10.0)
        assert gain.significant
        assert not offset.significant or offset.leaves_in_s is not None
        assert gain.leaves_in_s is not None
        assert gain.leaves_low_s is not None
        held += gain.leaves_low_s <= END - rows <= (gain.leaves_high_s or np.inf)
    # at 95 %, fewer than 10 of 12 have a chance of 2 %
    assert held >= 10


def test_what_has_long_been_straight_has_both_ends() -> None:
    gain = trends_of(COURSES["straight"], 20_000, 1).trends(0.05, 10.0)[0]
    assert gain.now == pytest.approx(-0.025, abs=0.002)
    assert gain.leaves_low_s is not None
    assert gain.leaves_high_s is not None
    assert 12_000.0 < gain.leaves_low_s < 20_000.0 < gain.leaves_high_s < 40_000.0


def test_what_stands_has_no_forecast() -> None:
    found = [trends_of(0.0, 6000, seed).trends(0.05, 10.0) for seed in range(20)]
    assert sum(x.significant for y in found for x in y) <= 3


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(st.integers(1, 5000), st.integers(0, 100))
def test_memory_does_not_grow_and_no_row_is_lost(part: int, seed: int) -> None:
    found = trends_of(0.0, 120_000, seed, part)
    assert len(found.sums) <= MOST_STRETCHES
    assert found.sums[:, 0].sum() == 120_000
    other = Trends()
    other.restore(json.loads(json.dumps(found.state())))
    assert np.array_equal(other.sums, found.sums)


def test_however_rows_arrive_the_sums_are_the_same_to_the_last_digit() -> None:
    whole = trends_of(1e-4, 9000, 3)
    assert all(np.array_equal(trends_of(1e-4, 9000, 3, part).sums, whole.sums) for part in (100, 1001))


def test_too_little_is_no_trend() -> None:
    assert trends_of(1.0, 300, 1).trends(0.05, 10.0) == []
    assert trends_of(0.0, 4000, 1).trends(0.05, 10.0)[0].now == pytest.approx(0.0, abs=0.01)
