"""The information criterion against hand numbers, and the autocorrelation time against statsmodels and a textbook."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from statsmodels.tsa.stattools import acf

from bender_discrepancy.fitting.criterion import (
    VERY_STRONG,
    Yardstick,
    autocorrelation_time,
    cost,
    independent_rows,
    price,
    yardstick,
)

ALL = np.ones(2000, dtype=bool)


def fitted(training: float = 1.0, held: float = 1.0, count: int = 0, residuals: tuple[Any, ...] = ()) -> Any:
    hypothesis = SimpleNamespace(free_count=count)
    return SimpleNamespace(training_square=training, held_square=held, hypothesis=hypothesis, residuals=residuals)


def first_order(phi: float, rows: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    values = np.empty(rows)
    values[0] = rng.normal()
    for k in range(1, rows):
        values[k] = phi * values[k - 1] + math.sqrt(1.0 - phi * phi) * rng.normal()
    return values


@pytest.mark.parametrize("phi", [0.0, 0.4, 0.9])
@pytest.mark.parametrize("seed", [1, 2])
def test_autocorrelation_time_is_that_of_statsmodels(phi: float, seed: int):
    values = first_order(phi, 2000, seed) + 3.0
    rho = np.asarray(acf(values, nlags=1999, adjusted=False, fft=True))
    below = np.flatnonzero(rho < 2.0 / math.sqrt(2000))
    expected = max(1.0, 1.0 + 2.0 * float(rho[1 : below[0]].sum()))
    assert autocorrelation_time(values, ALL) == pytest.approx(expected, rel=1e-9)


def test_rows_that_do_not_count_add_nothing():
    usable = np.arange(2000) % 3 > 0
    values = np.where(usable, first_order(0.7, 2000, 4), 1e9)
    other = np.where(usable, values, -5.0)
    assert autocorrelation_time(values, usable) == autocorrelation_time(other, usable)
    centred = np.where(usable, values - values[usable].mean(), 0.0)
    rho = np.correlate(centred, centred, "full")[1999:] / float(centred @ centred)
    end = int(np.flatnonzero(rho < 2.0 / math.sqrt(2000))[0])
    assert autocorrelation_time(values, usable) == pytest.approx(1.0 + 2.0 * rho[1:end].sum(), rel=1e-9)


def test_the_unit_of_the_residual_does_not_matter():
    values = first_order(0.6, 2000, 9)
    assert autocorrelation_time(1e-7 * values, ALL) == pytest.approx(autocorrelation_time(values, ALL), rel=1e-9)


def test_a_constant_and_an_alternating_residual_count_every_row():
    assert autocorrelation_time(np.full(2000, 7.0), ALL) == 1.0
    assert autocorrelation_time(np.resize([1.0, -1.0], 2000), ALL) == 1.0


def test_the_price_is_schwarz_with_the_correction_for_few_samples():
    assert price(3, 100.0) == pytest.approx(3.0 * math.log(100.0) * 100.0 / 95.0, rel=1e-12)
    assert price(0, 100.0) == 0.0
    assert price(4, 6.0) == math.inf
    assert price(4, 5.0) == math.inf
    assert math.isfinite(price(4, 6.001))


@given(st.integers(1, 20), st.floats(60.0, 1e6))
def test_more_numbers_cost_more(count: int, samples: float):
    assert price(count + 1, samples) > price(count, samples) > 0.0


def test_the_criterion_counts_independent_rows():
    by = Yardstick(rows=1000, effective_rows=250.0)
    expected = 250.0 * math.log((30.0 + 12.0) / 1000) + 2 * math.log(250.0) * 250.0 / 246.0
    assert cost(fitted(30.0, 12.0, 2), by) == pytest.approx(expected, rel=1e-12)
    assert math.isfinite(cost(fitted(0.0, 0.0, 0), by))


def test_a_number_that_explains_nothing_raises_it_and_one_that_halves_the_square_lowers_it():
    by = Yardstick(500, 500.0)
    assert cost(fitted(1.0, 1.0, 3), by) > cost(fitted(1.0, 1.0, 2), by)
    assert cost(fitted(0.5, 0.5, 3), by) < cost(fitted(1.0, 1.0, 2), by)


def test_the_threshold_allows_for_the_luckiest_start():
    assert Yardstick(1, 1.0).threshold == pytest.approx(2.0 * math.log(300) + VERY_STRONG)
    assert Yardstick(1, 1.0, 0).threshold == VERY_STRONG
    assert Yardstick(1, 1.0, 7).threshold == pytest.approx(2.0 * math.log(7) + 2.0 * math.log(100.0))
    assert Yardstick(1, 1.0, 7, 0.9).threshold == pytest.approx(2.0 * math.log(7) + 2.0 * math.log(10.0))


def test_the_luckiest_of_many_starts_stays_below_the_threshold():
    """Trying one number at m places on noise alone lowers n ln S by the largest of m chi-squared values."""
    rng = np.random.default_rng(5)
    starts, beyond = 200, 0
    for _ in range(300):
        noise = rng.normal(size=100)
        shapes = rng.normal(size=(starts, 100))
        shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
        best = float(noise @ noise) - float(np.max((shapes @ noise) ** 2))
        gain = 100.0 * math.log(float(noise @ noise) / best) - price(1, 100.0)
        beyond += gain > Yardstick(100, 100.0, starts).threshold - VERY_STRONG
    assert beyond <= 30


def of_records(*searched: np.ndarray) -> Any:
    chosen_on = np.arange(2000) % 5 == 0
    return SimpleNamespace(observations=tuple(SimpleNamespace(searched=x, judging=x & chosen_on) for x in searched))


def test_the_yardstick_adds_up_records():
    white, slow = first_order(0.0, 2000, 6), first_order(0.8, 2000, 7)
    half = np.arange(2000) < 1000
    by = yardstick(of_records(ALL, half), fitted(residuals=(white, slow)), 12)
    assert by.tried == 12
    assert by.rows == 3000 - sum(x.coefficients.size for x in by.filters)
    # innovations are white, so nearly every row counts
    assert by.effective_rows == pytest.approx(by.rows, rel=0.05)


def test_independent_rows_are_those_of_the_residual_as_it_stands():
    white, slow = first_order(0.0, 2000, 6), first_order(0.8, 2000, 7)
    half = np.arange(2000) < 1000
    expected = 2000 / autocorrelation_time(white, ALL) + 1000 / autocorrelation_time(slow, half)
    found = independent_rows(of_records(ALL, half), fitted(residuals=(white, slow)))
    assert found == pytest.approx(expected)


def test_what_a_slow_residual_would_hide_decides():
    rng = np.random.default_rng(12)
    drift = np.cumsum(0.1 * rng.normal(size=2000))
    quick = np.where(np.arange(2000) % 60 < 4, 1.0, 0.0)
    without, beside = fitted(count=0, residuals=(drift + quick,)), fitted(count=3, residuals=(drift,))
    by = yardstick(of_records(ALL), beside, 300)
    assert cost(beside, by) < cost(without, by) - by.threshold
    # a drift of another size gains nothing
    other = fitted(count=3, residuals=(1.001 * drift,))
    assert abs(cost(other, by) - cost(beside, by)) < VERY_STRONG


def test_a_beginning_that_fits_gains_nothing_on_the_rows_of_choices():
    noise = np.random.default_rng(5).normal(size=2000)
    bump = np.where(np.arange(2000) < 5, 8.0, 0.0) * (np.arange(2000) % 5 > 0)
    by = yardstick(of_records(ALL), fitted(residuals=(noise,)), 300)
    begun, better = fitted(residuals=(noise + bump,)), fitted(residuals=(noise,))
    assert cost(better, by) < cost(begun, by) - by.threshold
