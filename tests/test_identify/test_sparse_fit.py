"""Supports of a regression whose terms depend on one another, as on a record of one step."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_identify.regression.rates import Regression
from bender_identify.regression.sparse_fit import greedy_supports


def regression_of(columns: np.ndarray, rates: np.ndarray) -> Regression:
    count = columns.shape[1]
    return Regression(tuple(map(str, range(count))), columns, rates, np.ones(count), "weak", 1)


@given(st.integers(0, 10_000), st.integers(1, 4), st.sampled_from([0.0, 1e-14]))
def test_terms_that_others_add_up_to_are_not_offered(seed: int, dependent: int, rounding: float) -> None:
    rng = np.random.default_rng(seed)
    free = rng.standard_normal((60, 3))
    added_up = free @ rng.standard_normal((3, dependent)) + rounding * rng.standard_normal((60, dependent))
    rates = free @ np.array([1.0, 0.0, -0.5])
    found = greedy_supports(regression_of(np.column_stack([free, added_up]), rates))
    assert (0, 2) in found
    assert all(k < 3 for support in found for k in support)


@pytest.mark.parametrize("columns", [np.zeros((60, 2)), np.empty((60, 0))])
def test_terms_of_nothing_have_no_supports(columns: np.ndarray) -> None:
    assert greedy_supports(regression_of(columns, np.ones(60))) == []
