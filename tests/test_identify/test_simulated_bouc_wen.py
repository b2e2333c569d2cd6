"""The paper's simulated identification: its figure named for what it is, and ours in the metric of (29)."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bender_identify.paper.paper_sindy import naive_cubic, paper_recipe, plain_sindy_on
from bender_identify.paper.simulated_bouc_wen import (
    equation_29_percent,
    growing_tone,
    learn_bouc_wen,
    one_tone,
    squared_percent,
    three_tones,
    truth,
    two_tones,
    two_tones_rate,
)


def test_the_truth_is_that_of_an_independent_integration() -> None:
    def slope(t: float, w: np.ndarray) -> np.ndarray:
        rate = float(two_tones_rate(np.array([t]))[0])
        return 10.0 * rate - 0.75 * abs(rate) * w - 0.5 * rate * np.abs(w)

    t = np.linspace(0.0, 10.0, 101)
    exact = solve_ivp(slope, (0.0, 10.0), [0.0], "DOP853", t_eval=t, rtol=1e-9, atol=1e-9, max_step=0.01).y[0]
    assert truth(two_tones, t) == pytest.approx(exact, abs=1e-5)


def test_the_two_metrics_are_the_square_of_each_other() -> None:
    truth_um, other_um = np.array([1.0, 2.0, -2.0]), np.array([1.1, 2.0, -2.2])
    norm = equation_29_percent(truth_um, other_um)
    assert squared_percent(truth_um, other_um) == pytest.approx(norm**2 / 100.0)


def test_the_papers_number_is_the_squared_one() -> None:
    errors, values = paper_recipe()
    assert values.tolist() == [9.997, -0.75, -0.499]
    assert errors.squared == pytest.approx(2.743e-6, rel=1e-3)
    assert errors.trained == pytest.approx(1.66e-2, rel=0.01)


def test_polynomials_do_well_on_the_training_input_and_fail_on_another() -> None:
    errors, unseen = naive_cubic()
    assert errors.trained < 1e-3
    assert errors.unseen == pytest.approx(151.0, abs=1.0)
    assert equation_29_percent(unseen.truth_um, unseen.simulated_um) == errors.unseen


def test_without_noise_the_equation_comes_back() -> None:
    errors, found = learn_bouc_wen(1e-3, 0.0, np.random.default_rng(0), duration_s=8.0)
    assert [c.name for c in found.coefficients] == ["u'", "w |u'|", "|w| u'"]
    assert errors.trained <= 1e-6
    assert errors.unseen <= 1e-4


@pytest.mark.slow
def test_with_noise_an_unseen_input_is_met() -> None:
    inputs = (three_tones, growing_tone)
    errors, _ = learn_bouc_wen(1e-2, 1.0, np.random.default_rng(4), inputs, duration_s=100.0)
    assert errors.unseen <= 0.03
    assert errors.unseen < plain_sindy_on(1e-2, 1.0, np.random.default_rng(4), inputs, duration_s=100.0)


@pytest.mark.slow
def test_a_period_of_one_tone_is_enough_for_the_terms_under_noise() -> None:
    errors, found = learn_bouc_wen(1e-2, 1.0, np.random.default_rng(1), (one_tone,), duration_s=20.0)
    assert {c.name for c in found.coefficients} == {"u'", "w |u'|", "|w| u'"}
    assert errors.unseen < 0.3
