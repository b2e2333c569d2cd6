"""Regression and sparse supports: on signals whose equation is known exactly."""

import numpy as np
import pytest

from bender_identify.paper.simulated_bouc_wen import three_tones, truth
from bender_identify.records.experiment import Experiment, experiment_of
from bender_identify.records.voltage_path import even_times
from bender_identify.regression.rates import conditioning, regression_of
from bender_identify.regression.sparse_fit import ensemble_of, least_squares, likely, supports
from bender_identify.settings import LIBRARIES, Settings
from bender_loop.records.record import Record

TIME = even_times(0.01, 3001)
VOLTS = three_tones(TIME)
BOUC_WEN = truth(three_tones, TIME)


def made(reading: np.ndarray, volts: np.ndarray = VOLTS, time_s: np.ndarray = TIME) -> Experiment:
    return experiment_of(Record(time_s, volts, reading), "a", Settings(), "linear")


def noisy(percent: float) -> np.ndarray:
    noise = np.random.default_rng(7).standard_normal(len(TIME))
    return BOUC_WEN + 0.01 * percent * BOUC_WEN.std() * noise


def test_the_form_follows_the_noise() -> None:
    for reading, form in ((BOUC_WEN, "strong"), (noisy(1.0), "weak")):
        regression = regression_of(LIBRARIES["bouc_wen"], [made(reading)], 0.0, "auto")
        assert regression is not None
        assert regression.form == form


@pytest.mark.parametrize(
    ("percent", "form", "error"), [(0.0, "strong", 1e-3), (0.0, "weak", 0.02), (1.0, "weak", 0.03)]
)
def test_coefficients_come_out(percent: float, form: str, error: float) -> None:
    regression = regression_of(LIBRARIES["bouc_wen"], [made(noisy(percent))], 0.0, form)
    assert regression is not None
    assert least_squares(regression, (0, 1, 2)) == pytest.approx([10.0, -0.75, -0.5], rel=error, abs=error)


def test_lost_frames_and_uneven_times_leave_the_coefficients() -> None:
    kept = np.sort(np.random.default_rng(1).choice(len(TIME), 2700, replace=False))
    kept[0] = 0
    reading = BOUC_WEN.copy()
    reading[500:502] = np.nan
    reading[900:960] = np.nan
    regression = regression_of(LIBRARIES["bouc_wen"], [made(reading[kept], VOLTS[kept], TIME[kept])], 0.0, "weak")
    assert regression is not None
    assert least_squares(regression, (0, 1, 2)) == pytest.approx([10.0, -0.75, -0.5], rel=0.05, abs=0.05)


def test_scaling_the_displacement_and_the_voltage_changes_no_support() -> None:
    big = Record(TIME, 50.0 * VOLTS, 0.02 * BOUC_WEN)
    one = regression_of(LIBRARIES["combined"], [made(BOUC_WEN)], 0.0, "weak")
    other = regression_of(LIBRARIES["combined"], [experiment_of(big, "b", Settings(), "linear")], 0.0, "weak")
    assert one is not None
    assert other is not None
    assert supports(one) == supports(other)


def test_the_true_terms_are_among_the_supports() -> None:
    terms = ("u'", "w |u'|", "|w| u'", "w", "u")
    regression = regression_of(terms, [made(noisy(0.3))], 0.0, "weak")
    assert regression is not None
    assert (0, 1, 2) in supports(regression)


def test_terms_that_do_the_same_are_left_out_and_named() -> None:
    volts = 2.0 + np.sin(TIME)
    regression = regression_of(("w", "|w|", "u", "u'"), [made(3.0 * volts + np.cos(TIME), volts)], 0.0, "strong")
    assert regression is not None
    assert regression.terms == ("w", "u", "u'")
    assert regression.twins == (("|w|", "w"),)


def test_collinear_columns_are_seen_in_the_condition_number() -> None:
    u, rate = np.sin(TIME), np.cos(TIME)
    condition, _, vectors = conditioning(np.column_stack([np.ones_like(u), u**2, rate**2]))
    assert condition > 1e12
    assert np.all(np.abs(vectors[-1]) > 0.3)


def test_the_ensemble_is_reproducible_and_sure_of_the_truth() -> None:
    regression = regression_of(LIBRARIES["combined"], [made(noisy(0.3))], 0.0, "weak")
    assert regression is not None
    draws = [ensemble_of(regression, 20, 0.05, np.random.default_rng(s)) for s in (4, 4, 5)]
    assert np.array_equal(draws[0].median, draws[1].median)
    assert not np.array_equal(draws[0].median, draws[2].median)
    kept = {regression.terms[k] for k in likely(draws[0])}
    assert {"u'", "w |u'|"} <= kept
    assert draws[0].median[regression.terms.index("u'")] == pytest.approx(10.0, rel=0.1)
