"""What makes one hypothesis better than another: signs, scales, and what chance alone brings about."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from bender_discrepancy.search.judgement.probability import Case, probability
from bender_discrepancy.search.judgement.score import difference, likelihood_deviate, log_deviate, normal_deviate

SEEDS = st.integers(0, 2**32 - 1)
ROWS = 400
COUNTED = (np.ones(ROWS, dtype=np.bool_),)


def noise(seed: int, size: int = ROWS) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(size)


@given(SEEDS, st.floats(0.2, 5.0))
@examples(max_examples=40)
def test_what_is_gained_on_one_side_is_lost_on_the_other(seed: int, size: float) -> None:
    one, other = (noise(seed),), (size * noise(seed + 1),)
    ahead, behind = difference(one, other, COUNTED), difference(other, one, COUNTED)
    assert ahead.deviations == pytest.approx(-behind.deviations, rel=1e-6, abs=1e-9)
    assert ahead.ratio * behind.ratio == pytest.approx(1.0)
    squares = one[0] ** 2, other[0] ** 2
    assert log_deviate(*squares) == pytest.approx(-log_deviate(*squares[::-1]), rel=1e-6, abs=1e-9)
    assert math.copysign(1.0, likelihood_deviate(one, other, COUNTED)) == (1.0 if ahead.ratio > 1.0 else -1.0)


@given(SEEDS, st.floats(1e-3, 1e3))
@examples(max_examples=30)
def test_no_score_depends_on_the_unit_of_the_errors(seed: int, scale: float) -> None:
    one, other = noise(seed), 1.3 * noise(seed + 1)
    scaled = difference((scale * one,), (scale * other,), COUNTED)
    assert scaled.deviations == pytest.approx(difference((one,), (other,), COUNTED).deviations, rel=1e-6, abs=1e-6)
    squares = one**2, other**2
    expected = log_deviate(*squares)
    assert log_deviate(*(scale**2 * x for x in squares)) == pytest.approx(expected, rel=1e-6, abs=1e-6)


@given(SEEDS, st.floats(0.5, 3.0))
@examples(max_examples=30)
def test_structure_that_only_one_leaves_counts_for_the_other(seed: int, size: float) -> None:
    """Beside noise without a share of it: such a share, by chance, hides a small structure or shows it too well."""
    structure = np.sin(0.3 * np.arange(ROWS))
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


def test_rows_that_do_not_count_decide_nothing() -> None:
    counted = np.arange(ROWS) % 4 > 0
    one, other = noise(1), 1.5 * noise(2)
    wild = np.where(counted, other, 1e6)
    assert difference((one,), (wild,), (counted,)) == difference((one,), (other,), (counted,))


@given(SEEDS, st.integers(3, 40), st.floats(-2.0, 2.0))
@examples(max_examples=30)
def test_a_deviate_is_that_of_the_t_test(seed: int, count: int, shift: float) -> None:
    from scipy.stats import norm, ttest_1samp

    gains = noise(seed, count) + shift
    expected: Any = ttest_1samp(gains, 0.0)
    assert normal_deviate(gains) == pytest.approx(
        math.copysign(float(norm.isf(max(expected.pvalue, 1e-300) / 2.0)), expected.statistic), rel=1e-6, abs=1e-9
    )


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
