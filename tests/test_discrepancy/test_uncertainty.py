"""Deviations of fitted numbers: the sandwich, and how much wider it is where few rows determine a number."""

import numpy as np
from scipy.stats import t as student_t

from bender_discrepancy.fitting.uncertainty import sandwich


def _drawn(rng: np.random.Generator, fast_rows: int, count: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Slopes and a residual that is large where the slopes are: late stamps, skewed."""
    slopes = 0.01 * rng.normal(size=(count, 1))
    slopes[:: count // fast_rows][:fast_rows] = 1.0
    size = np.where(slopes[:, 0] == 1.0, 1.0, 0.01)
    return slopes, size * (rng.exponential(size=count) - 1.0)


def _coverage(fast_rows: int, trials: int = 600) -> tuple[float, float]:
    rng = np.random.default_rng(fast_rows)
    within = np.zeros(2)
    for _ in range(trials):
        slopes, error = _drawn(rng, fast_rows)
        inverse = np.linalg.inv(slopes.T @ slopes).astype(np.float64)
        found = float((inverse @ slopes.T @ error)[0])
        residual = error - slopes[:, 0] * found
        classical = float(np.sqrt(np.mean(residual**2) * inverse[0, 0]))
        within += abs(found) < 1.96 * np.array([classical, np.sqrt(sandwich(slopes, inverse, residual)[0])])
    return float(within[0] / trials), float(within[1] / trials)


def test_the_sandwich_covers_where_few_rows_that_tremble_determine_a_number() -> None:
    for fast_rows in (12, 30):
        classical, wide = _coverage(fast_rows)
        assert classical < 0.7
        assert 0.88 < wide < 0.98


def test_residuals_of_one_size_give_the_classical_deviation() -> None:
    rng = np.random.default_rng(3)
    slopes, residual = rng.normal(size=(20_000, 2)), rng.normal(size=20_000)
    inverse = np.linalg.inv(slopes.T @ slopes).astype(np.float64)
    np.testing.assert_allclose(sandwich(slopes, inverse, residual), np.diag(inverse), rtol=0.1)


def test_two_rows_alone_widen_as_students_distribution_does() -> None:
    slopes, residual = np.zeros((40, 1)), np.zeros(40)
    slopes[[5, 30]], residual[[5, 30]] = 1.0, 1.0
    inverse = np.array([[0.5]])
    # shares of 1 each after the leverage of a half; two degrees of freedom, halved and doubled by the fourth powers
    widening = (student_t.ppf(0.975, 4.0) / 1.959964) ** 2
    np.testing.assert_allclose(sandwich(slopes, inverse, residual), [2.0 * widening], rtol=1e-6)


def test_an_undetermined_number_has_no_sandwich() -> None:
    slopes = np.ones((20, 1))
    assert sandwich(slopes, np.array([[np.inf]]), np.ones(20))[0] == 0.0
