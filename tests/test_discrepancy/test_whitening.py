"""Innovations of a residual against statsmodels, a first-order process, and the laws that a comparison needs."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from statsmodels.regression.linear_model import yule_walker

from bender_discrepancy.fitting.whitening import whitening

ROWS = 4000
ALL = np.ones(ROWS, dtype=bool)


def process(coefficients: tuple[float, ...], seed: int, rows: int = ROWS) -> np.ndarray:
    rng = np.random.default_rng(seed)
    values = np.zeros(rows + 200)
    for k in range(len(coefficients), values.size):
        values[k] = rng.normal() + sum(a * values[k - 1 - j] for j, a in enumerate(coefficients))
    return values[200:]


@pytest.mark.parametrize("coefficients", [(0.7,), (1.2, -0.5), (0.3, 0.2, -0.4)])
def test_the_filter_is_that_of_statsmodels(coefficients: tuple[float, ...]) -> None:
    values = process(coefficients, 3)
    found = whitening(values, ALL).coefficients
    assert len(coefficients) <= found.size <= len(coefficients) + 2
    # of pairs of rows, as the covariances here: the adjusted ones
    theirs: Any = yule_walker(values, order=found.size, method="adjusted", result_object=True)
    assert found == pytest.approx(theirs.rho, abs=1e-6)


def test_innovations_have_the_variance_of_what_drives_the_process() -> None:
    values = process((0.95,), 5, 100_000)
    usable = np.ones(values.size, dtype=bool)
    left = whitening(values, usable).innovations(values)
    assert float(np.var(left)) == pytest.approx(1.0, rel=0.03)
    assert float(np.var(values)) == pytest.approx(1.0 / (1.0 - 0.95**2), rel=0.2)
    assert abs(float(np.corrcoef(left[1:], left[:-1])[0, 1])) < 0.02


def test_white_noise_is_left_as_it_is() -> None:
    values = np.random.default_rng(8).normal(size=ROWS)
    filtered = whitening(values, ALL)
    assert filtered.coefficients.size == 0
    assert filtered.innovations(values) == pytest.approx(values)


@given(st.floats(1e-9, 1e9), st.integers(0, 5))
@examples(max_examples=20)
def test_the_unit_of_the_residual_does_not_matter(scale: float, seed: int) -> None:
    values = process((0.8,), seed, 600)
    usable = np.arange(600) % 50 > 0
    one, other = whitening(values, usable), whitening(scale * values, usable)
    assert one.coefficients == pytest.approx(other.coefficients, rel=1e-6, abs=1e-9)
    assert scale * one.innovations(values) == pytest.approx(one.innovations(scale * values), rel=1e-9)


def test_what_is_read_in_rows_that_do_not_count_changes_nothing() -> None:
    values, usable = process((0.8,), 4), np.ones(ROWS, dtype=bool)
    usable[500:700] = False
    usable[::37] = False
    spoiled = np.where(usable, values, 1e6)
    lost = np.where(usable, values, np.nan)
    first = whitening(values, usable)
    for other in (spoiled, lost):
        second = whitening(other, usable)
        assert first.coefficients == pytest.approx(second.coefficients)
        assert first.innovations(values) == pytest.approx(second.innovations(other))
    left = first.innovations(values)
    assert left.size == int(usable[first.coefficients.size :].sum())


def test_a_slow_residual_does_not_hide_what_a_quick_one_gains() -> None:
    # a drift that stays, and pulses that the better hypothesis has taken away
    rng = np.random.default_rng(2)
    drift = np.cumsum(0.05 * rng.normal(size=ROWS))
    pulses = np.where(np.arange(ROWS) % 80 < 3, 0.6, 0.0)
    noise = 0.05 * rng.normal(size=ROWS)
    worse, better = drift + pulses + noise, drift + noise
    seen = whitening(better, ALL)
    plain = math.log(float(np.sum(worse**2)) / float(np.sum(better**2)))
    weighed = math.log(float(np.sum(seen.innovations(worse) ** 2)) / float(np.sum(seen.innovations(better) ** 2)))
    assert weighed > 5.0 * abs(plain)


def test_a_residual_of_nothing_has_no_filter() -> None:
    assert whitening(np.zeros(100), np.ones(100, dtype=bool)).coefficients.size == 0
