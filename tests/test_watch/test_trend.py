"""Slow changes: slope, forecast, memory."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_watch.trend import MOST_STRETCHES, Trends


def trends_of(slope: float, rows: int, seed: int, part: int = 4096) -> Trends:
    rng = np.random.default_rng(seed)
    time, z = np.arange(rows, dtype=float), rng.standard_normal(rows)
    e = rng.standard_normal(rows) + slope * time * z
    found = Trends(0.01, 0.1)
    for a in range(0, rows, part):
        cut = slice(a, a + part)
        found.add(time[cut], e[cut], np.ones(rows)[cut], z[cut])
    return found


def test_a_gain_that_fades_is_a_trend_and_its_forecast_holds_the_truth() -> None:
    held = 0
    for seed in range(40):
        gain, offset = trends_of(-1e-4, 8000, seed).trends(0.05, 10.0)
        assert gain.significant
        assert not offset.significant or offset.leaves_in_s is not None
        assert gain.leaves_low_s is not None
        # -1e-4 a row in units of 1 % of the gain: 5 % are gone after 50 000 rows
        truth = 50_000.0 - 8000.0
        held += gain.leaves_low_s <= truth <= (gain.leaves_high_s or np.inf)
    assert held >= 34


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
    other = Trends(0.01, 0.1)
    other.restore(json.loads(json.dumps(found.state())))
    assert np.array_equal(other.sums, found.sums)


def test_too_little_is_no_trend() -> None:
    assert trends_of(1.0, 300, 1).trends(0.05, 10.0) == []
    assert trends_of(0.0, 4000, 1).trends(0.05, 10.0)[0].now == pytest.approx(0.0, abs=0.01)
