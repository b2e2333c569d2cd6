"""The parts of a gap that the effects of one hypothesis close, from archives of which everything is known."""

from dataclasses import replace

import numpy as np
import pytest
from reported_diagnosis import hypothesis, record_of, told
from scipy.signal import lfilter

from bender_discrepancy.conclusion.contenders import contenders
from bender_discrepancy.conclusion.measurement.gap import after_calibration, recalibrated_readings
from bender_discrepancy.conclusion.shares import held_square_um2, shares_of_gap
from bender_plant.model import load_model

PAPER = load_model("paper")
LAG, HUM = ("source_resistance", (0.06,)), ("periodic_disturbance", (0.5, 0.0, 1.3))


@pytest.fixture(scope="module")
def both():
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.06}})
    best = hypothesis(PAPER, [record], LAG, HUM)
    return told([record], best, [hypothesis(PAPER, [record], x) for x in (LAG, HUM)])


def test_shares_add_up_to_what_the_hypothesis_closes(both) -> None:
    archive, base, best = both.archive, both.found.base, both.best
    shares = shares_of_gap(archive, base, best)
    gap, left = (held_square_um2(x, archive.problem) - archive.noise_um**2 for x in (base, best))
    assert set(shares) == set(best.hypothesis.effects)
    assert sum(shares.values()) == pytest.approx(1.0 - max(left, 0.0) / gap, abs=1e-6)
    assert shares["source_resistance"] > 0.9 > 0.1 > shares["periodic_disturbance"]


def test_the_order_of_the_effects_does_not_matter(both) -> None:
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.06}})
    other = told([record], hypothesis(PAPER, [record], HUM, LAG), [hypothesis(PAPER, [record], x) for x in (LAG, HUM)])
    one = shares_of_gap(both.archive, both.found.base, both.best)
    assert shares_of_gap(other.archive, other.found.base, other.best) == pytest.approx(one, abs=1e-6)


def test_an_effect_alone_has_all_that_is_closed() -> None:
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.06}})
    alone = told([record], hypothesis(PAPER, [record], LAG), [])
    assert contenders(alone)[0].share_of_gap == pytest.approx(1.0, abs=0.01)


def test_calibration_stands_only_where_it_predicts_blocks_that_it_was_not_fitted_to() -> None:
    off = told([record_of(gain=0.9)], word="recalibrated")
    given, alone = recalibrated_readings(off)
    assert abs(alone[0] - given[0]).max() > 1.0
    true = told([record_of()], word="no_gap")
    given, _ = recalibrated_readings(true)
    measured = [x.measured_um for x in true.problem.observations]
    # the readings themselves: nothing can predict better
    assert after_calibration(true, measured, measured) is measured


def test_calibration_that_gains_less_than_its_error_hardly_ever_stands(both) -> None:
    """Of readings that wander about the model as given, gain and offset follow the wandering."""
    measured, stood = both.problem.observations[0].measured_um, 0
    for seed in range(40):
        left = np.asarray(lfilter([1.0], [1.0, -0.98], np.random.default_rng(seed).normal(size=measured.size)))
        fitted = replace(both.found.base, residuals=(left - left.mean(),))
        simulated = [measured - left]
        wandering = replace(both, found=replace(both.found, base=fitted))
        stood += after_calibration(wandering, simulated, simulated) is not simulated
    assert stood <= 12
