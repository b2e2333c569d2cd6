"""Thresholds run as long as they say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr

from bender_watch.sequential import run_length as lengths


def simulated_run_length(reference: float, threshold: float, rows: int, seed: int) -> float:
    """Mean rows between crossings of a CUSUM of normal rows that begins anew after each."""
    total, crossings = 0.0, 0
    for x in np.random.default_rng(seed).standard_normal(rows):
        total = max(0.0, total + x - reference)
        if total >= threshold:
            total, crossings = 0.0, crossings + 1
    return rows / crossings


@pytest.mark.parametrize("reference", [0.25, 0.5, 1.0])
def test_approximation_chain_and_simulation_agree(reference: float) -> None:
    threshold = lengths.cusum_threshold(300.0, reference)
    chain = lengths.markov_run_length(ndtr, reference, threshold)
    assert lengths.siegmund_run_length(reference, threshold) == pytest.approx(300.0, rel=0.02)
    assert chain == pytest.approx(300.0, rel=0.08)
    assert simulated_run_length(reference, threshold, 150_000, 1) == pytest.approx(chain, rel=0.2)


@given(st.floats(1e2, 1e9), st.floats(1.1, 100.0))
def test_rarer_false_alarms_have_higher_thresholds(run_length: float, factor: float) -> None:
    assert lengths.glr_threshold(run_length * factor, 9.0) > lengths.glr_threshold(run_length, 9.0)


def test_the_union_of_few_windows_is_below_all_of_them() -> None:
    few, many = lengths.glr_threshold(1e6, 2.0), lengths.glr_threshold(1e6, 1e6)
    assert few < many
    assert lengths.glr_run_length(many) == pytest.approx(1e6, rel=1e-3)
    assert 2.0 * 2.0 * ndtr(-few) == pytest.approx(1e-6, rel=1e-6)


@given(st.floats(0.5, 5.0), st.floats(-6.0, 6.0))
def test_what_is_clipped_has_no_tail(clip: float, value: float) -> None:
    at = np.array([value])
    normal, square = lengths.clipped_normal(clip)(at)[0], lengths.clipped_square(clip)(at)[0]
    assert normal == (1.0 if value >= clip else 0.0 if value < -clip else pytest.approx(ndtr(value)))
    assert square == (1.0 if value >= clip**2 else 0.0 if value < 0.0 else pytest.approx(2.0 * ndtr(value**0.5) - 1.0))


def test_a_run_length_of_a_few_rows_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 10 rows"):
        lengths.glr_threshold(5.0, 9.0)
