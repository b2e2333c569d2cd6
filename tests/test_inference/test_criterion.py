"""What makes one hypothesis better than another: the criterion, innovations and scores."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from statsmodels.regression.linear_model import yule_walker
from statsmodels.tsa.stattools import acf

from bender_inference.fitting.criterion import (
    Yardstick,
    autocorrelation_time,
    cost,
    independent_rows,
    price,
    very_strong,
    yardstick,
)
from bender_inference.fitting.whitening import whitening
from bender_inference.search.judgement.probability import Case, probability
from bender_inference.search.judgement.score import difference, likelihood_deviate, log_deviate, normal_deviate

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
    assert Yardstick(1, 1.0).threshold == pytest.approx(2.0 * math.log(300) + very_strong())
    assert Yardstick(1, 1.0, 0).threshold == very_strong()
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
        beyond += gain > Yardstick(100, 100.0, starts).threshold - very_strong()
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
    assert abs(cost(other, by) - cost(beside, by)) < very_strong()


def test_a_beginning_that_fits_gains_nothing_on_the_rows_of_choices():
    noise = np.random.default_rng(5).normal(size=2000)
    bump = np.where(np.arange(2000) < 5, 8.0, 0.0) * (np.arange(2000) % 5 > 0)
    by = yardstick(of_records(ALL), fitted(residuals=(noise,)), 300)
    begun, better = fitted(residuals=(noise + bump,)), fitted(residuals=(noise,))
    assert cost(better, by) < cost(begun, by) - by.threshold


ROWS = 4000
EVERY_ROW = np.ones(ROWS, dtype=bool)


def process(coefficients: tuple[float, ...], seed: int, rows: int = ROWS) -> np.ndarray:
    rng = np.random.default_rng(seed)
    values = np.zeros(rows + 200)
    for k in range(len(coefficients), values.size):
        values[k] = rng.normal() + sum(a * values[k - 1 - j] for j, a in enumerate(coefficients))
    return values[200:]


@pytest.mark.parametrize("coefficients", [(0.7,), (1.2, -0.5), (0.3, 0.2, -0.4)])
def test_the_filter_is_that_of_statsmodels(coefficients: tuple[float, ...]) -> None:
    values = process(coefficients, 3)
    found = whitening(values, EVERY_ROW).coefficients
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
    filtered = whitening(values, EVERY_ROW)
    assert filtered.coefficients.size == 0
    assert filtered.innovations(values) == pytest.approx(values)


@given(st.floats(1e-9, 1e9), st.integers(0, 5))
@examples(max_examples=20)
def test_the_unit_of_the_residual_does_not_matter_of_whitening(scale: float, seed: int) -> None:
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


def test_a_residual_of_nothing_has_no_filter() -> None:
    assert whitening(np.zeros(100), np.ones(100, dtype=bool)).coefficients.size == 0


SEEDS = st.integers(0, 2**32 - 1)
SCORED = 400
COUNTED = (np.ones(SCORED, dtype=np.bool_),)


def noise(seed: int, size: int = SCORED) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(size)


@given(SEEDS, st.floats(0.2, 5.0))
@examples(max_examples=25)
def test_what_is_gained_on_one_side_is_lost_on_the_other(seed: int, size: float) -> None:
    one, other = (noise(seed),), (size * noise(seed + 1),)
    ahead, behind = difference(one, other, COUNTED), difference(other, one, COUNTED)
    assert ahead.deviations == pytest.approx(-behind.deviations, rel=1e-6, abs=1e-9)
    assert ahead.ratio * behind.ratio == pytest.approx(1.0)
    squares = one[0] ** 2, other[0] ** 2
    assert log_deviate(*squares) == pytest.approx(-log_deviate(*squares[::-1]), rel=1e-6, abs=1e-9)
    assert math.copysign(1.0, likelihood_deviate(one, other, COUNTED)) == (1.0 if ahead.ratio > 1.0 else -1.0)


@given(SEEDS, st.floats(1e-3, 1e3))
@examples(max_examples=20)
def test_no_score_depends_on_the_unit_of_the_errors(seed: int, scale: float) -> None:
    one, other = noise(seed), 1.3 * noise(seed + 1)
    scaled = difference((scale * one,), (scale * other,), COUNTED)
    assert scaled.deviations == pytest.approx(difference((one,), (other,), COUNTED).deviations, rel=1e-6, abs=1e-6)
    squares = one**2, other**2
    expected = log_deviate(*squares)
    assert log_deviate(*(scale**2 * x for x in squares)) == pytest.approx(expected, rel=1e-6, abs=1e-6)


@given(SEEDS, st.floats(0.5, 3.0))
@examples(max_examples=20)
def test_structure_that_only_one_leaves_counts_for_the_other(seed: int, size: float) -> None:
    """Beside noise without a share of it: such a share, by chance, hides a small structure or shows it too well."""
    structure = np.sin(0.3 * np.arange(SCORED))
    errors = noise(seed)
    errors -= (errors @ structure) / (structure @ structure) * structure
    worse = errors + size * structure
    found = difference((errors,), (worse,), COUNTED)
    assert found.ratio == pytest.approx(1.0 + size**2 * (structure @ structure) / (errors @ errors))
    assert found.deviations > 2.0
    assert likelihood_deviate((errors,), (worse,), COUNTED) > 2.0


def test_chance_is_no_better_than_chance() -> None:
    """Of two equally good hypotheses one is ahead by two standard errors about as rarely as a normal deviate is."""
    found = [difference((noise(k),), (noise(10_000 + k),), COUNTED).deviations for k in range(400)]
    assert np.mean(np.abs(found) > 1.96) < 0.10
    assert abs(float(np.mean(found))) < 0.2


def test_a_noisy_record_does_not_lend_its_ratio_to_the_rows_of_a_quiet_one() -> None:
    """What takes a little off the noisy record alone, by chance, is no evidence in the quiet one, however long."""
    quiet, loud = 0.02 * noise(1, 3000), noise(2, 300)
    counted = tuple(np.ones(x.size, dtype=np.bool_) for x in (quiet, loud))
    alone = likelihood_deviate((loud,), (1.02 * loud,), counted[1:])
    assert likelihood_deviate((quiet, loud), (quiet, 1.02 * loud), counted) == pytest.approx(alone)
    both = likelihood_deviate((quiet, loud), (1.02 * quiet, 1.02 * loud), counted)
    assert both == pytest.approx(math.hypot(likelihood_deviate((quiet,), (1.02 * quiet,), counted[:1]), alone))


def test_rows_that_do_not_count_decide_nothing() -> None:
    counted = np.arange(SCORED) % 4 > 0
    one, other = noise(1), 1.5 * noise(2)
    wild = np.where(counted, other, 1e6)
    assert difference((one,), (wild,), (counted,)) == difference((one,), (other,), (counted,))


@given(SEEDS, st.integers(3, 40), st.floats(-2.0, 2.0))
@examples(max_examples=20)
def test_a_deviate_is_that_of_the_t_test(seed: int, count: int, shift: float) -> None:
    from scipy.stats import norm, ttest_1samp

    gains = noise(seed, count) + shift
    expected: Any = ttest_1samp(gains, 0.0)
    assert normal_deviate(gains) == pytest.approx(
        math.copysign(float(norm.isf(max(expected.pvalue, 1e-300) / 2.0)), expected.statistic), rel=1e-6, abs=1e-9
    )


def test_a_case_is_kept_within_what_its_parts_can_tell() -> None:
    assert Case.of(-3.0, 0.0, 0.0, -1.0) == Case(0.0, 0.0, 0.0)
    assert Case.of(0.5, 2.0, 1.5, 0.25).parts == pytest.approx((1.0, 0.0, 0.5, math.log(4.0 / 3.0), 0.25))
    assert Case.of(99.0, 1e9, 0.0, 7.0) == Case(8.0, 4.0, 1.0)
    assert Case.of(1.0, 1.0, 2.0, 1.0).log_ratio == 0.0


UNIT = st.floats(-1.0, 2.0)
SQUARES = st.floats(0.0, 1e6)


@given(st.floats(-10.0, 50.0), SQUARES, SQUARES, UNIT, st.floats(0.0, 5.0))
def test_more_evidence_makes_an_effect_more_probable(
    deviations: float, rest_um2: float, left_um2: float, closed: float, more: float
) -> None:
    before = probability(Case.of(deviations, rest_um2, left_um2, closed))
    assert 0.0 < before < 1.0
    assert probability(Case.of(deviations + more, rest_um2, left_um2, closed)) >= before
    assert probability(Case.of(deviations, rest_um2, left_um2, closed + more)) >= before
    assert probability(Case.of(deviations, rest_um2 * (1.0 + more), left_um2, closed)) >= before - 1e-12
