import numpy as np
import pytest

from bender_identify.fitting.candidate import Candidate
from bender_identify.fitting.correlation import correlation_rows
from bender_identify.fitting.output_error import information
from bender_identify.fitting.repeating import repeating_factor
from bender_identify.paper.simulated_bouc_wen import nothing_else, three_tones, truth
from bender_identify.records.experiment import experiment_of
from bender_identify.records.voltage_path import even_times
from bender_identify.regression.equation_search import equation_of
from bender_identify.settings import Settings
from bender_loop.records.record import Record

TIME = even_times(0.05, 600)
TERMS = ("u'", "w |u'|", "|w| u'")
START = np.array([9.0, -0.7, -0.4])


def fitted(seed: int) -> Candidate:
    rng = np.random.default_rng(seed)
    w = truth(three_tones, TIME)
    record = Record(TIME, three_tones(TIME), w + 0.02 * w.std() * rng.standard_normal(len(w)))
    experiment = experiment_of(record, "a", Settings(), "linear").fitting_all()
    return equation_of(TERMS, START, [experiment], nothing_else())


@pytest.mark.slow
def test_the_covariance_is_the_scatter_over_repeated_noise() -> None:
    fits = [fitted(seed) for seed in range(12)]
    values = np.array([f.fit.values for f in fits])
    told = np.mean([[c.std or 0.0 for c in f.coefficients] for f in fits], axis=0)
    assert np.std(values, axis=0) == pytest.approx(told, rel=0.6)
    assert np.mean(values, axis=0) == pytest.approx([10.0, -0.75, -0.5], abs=4.0 * told.max() / np.sqrt(12))


def test_intervals_hold_the_truth_and_the_offset_is_dropped() -> None:
    found = fitted(99)
    for coefficient, true in zip(found.coefficients, (10.0, -0.75, -0.5), strict=True):
        assert coefficient.half_width is not None
        assert abs(coefficient.value - true) < coefficient.half_width
    assert found.fit.offset_um == 0.0
    assert found.parameters == 3


@pytest.mark.parametrize("share", [0.0, 0.5, 0.9])
def test_correlated_residuals_count_less(share: float) -> None:
    rng = np.random.default_rng(1)
    noise, x = rng.standard_normal(20_000), np.zeros(20_000)
    for k in range(1, len(x)):
        x[k] = share * x[k - 1] + noise[k]
    assert correlation_rows(x) == pytest.approx((1.0 + share) / (1.0 - share), rel=0.25)


def test_the_criterion_asks_a_price_for_every_parameter() -> None:
    assert information(1.0, 1000, 3, 1.0, 0.0) < information(1.0, 1000, 4, 1.0, 0.0)
    assert information(0.9, 1000, 4, 1.0, 0.0) < information(1.0, 1000, 3, 1.0, 0.0)
    assert information(1e-30, 1000, 4, 1.0, 1e-6) > information(1e-25, 1000, 3, 1.0, 1e-6)


def test_what_comes_back_in_every_cycle_does_not_average_out() -> None:
    time = even_times(1 / 30, 1200)
    volts = 10.0 * np.sin(np.pi * time)
    experiment = experiment_of(Record(time, volts, 0.9 * volts), "a", Settings(), "smooth").fitting_all()
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(int(experiment.fitted.sum()))
    repeated = np.cos(3.0 * np.pi * experiment.time_s[experiment.fitted])
    assert repeating_factor([experiment], noise, 1.0) == 1.0
    assert repeating_factor([experiment], np.zeros_like(noise), 1.0) == 1.0
    half, more = (repeating_factor([experiment], noise + share * repeated, 1.0) for share in (0.5, 1.0))
    assert 1.5 < half < more


def test_without_cycles_nothing_repeats() -> None:
    experiment = experiment_of(Record(TIME, three_tones(TIME), truth(three_tones, TIME)), "a", Settings(), "linear")
    residual = np.cos(experiment.time_s[experiment.fitted])
    assert repeating_factor([experiment], residual, 1.0) == 1.0
