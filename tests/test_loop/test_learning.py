"""Iterative learning on plants whose error from pass to pass is known."""

import math

import numpy as np
import pytest
from tests.test_loop.test_model_following import PERIOD_S

from bender_export.slaves.following import FollowedPlant
from bender_loop.control.following_loop import simulate_following
from bender_loop.control.learning import begin, first_reached, learn, smooth
from bender_loop.control.model_following import ModelFollower
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Profile
from bender_loop.control.sampling import Sampling
from bender_plant.model import load_model
from bender_plant.plant import Plant

REFERENCE = 5.0 - 5.0 * np.cos(2.0 * np.pi * np.arange(80) / 20.0)


def test_a_gain_that_is_wrong_leaves_its_part_in_every_pass():
    """Slow parts pass the smoothing, so the error falls by 1 - 0.9 a for a gain a."""
    known = begin(REFERENCE)
    for _ in range(6):
        known = learn(known, REFERENCE, 0.8 * known.target_um, 0.0)
    ratios = np.array(known.errors_um[1:4]) / known.errors_um[:3]
    assert ratios == pytest.approx([1.0 - 0.9 * 0.8] * 3, abs=0.05)
    assert known.errors_um[5] < known.errors_um[0] / 50.0


def test_learning_ends_by_itself_and_keeps_the_best():
    rng, known = np.random.default_rng(3), begin(REFERENCE)
    while not known.is_over:
        known = learn(known, REFERENCE, 0.7 * known.target_um + rng.normal(0.0, 0.1, REFERENCE.size), 0.1)
        assert len(known.errors_um) < 30
    assert known.best_error_um < 0.2


def test_noise_alone_teaches_nothing():
    rng = np.random.default_rng(4)
    known = learn(begin(REFERENCE), REFERENCE, REFERENCE + rng.normal(0.0, 0.1, REFERENCE.size), 0.1)
    assert np.abs(known.target_um - REFERENCE).max() < 0.05


@pytest.mark.parametrize("dead_time_s", [0.0, 0.05])
def test_what_is_missed_before_a_command_can_show_is_not_held_against_a_pass(dead_time_s: float):
    begins = first_reached(dead_time_s, PERIOD_S)
    assert begins == 1 + math.ceil(dead_time_s / PERIOD_S)
    missed = np.where(np.arange(REFERENCE.size) < begins, 3.0, 0.0)
    known = learn(begin(REFERENCE), REFERENCE, REFERENCE - missed, 0.0, begins)
    assert known.errors_um == (0.0,)
    assert known.target_um == pytest.approx(REFERENCE)


def test_the_smoothing_shifts_nothing_and_keeps_a_straight_line():
    line = np.linspace(0.0, 3.0, 40)
    assert smooth(line)[1:-1] == pytest.approx(line[1:-1])
    pulse = np.zeros(21)
    pulse[10] = 1.0
    assert smooth(pulse) == pytest.approx(smooth(pulse)[::-1])


def test_a_scan_of_1_Hz_over_unknown_hysteresis_and_creep_is_learned_within_eight_passes():
    """The model knows neither; six seconds at 30 frames a second, from rest."""
    period_s = 1.0 / 30.0
    times = np.arange(181) * period_s
    height = 9.0 - 4.0 * np.abs(2.0 * (np.clip(times - 1.0, 0.0, 4.0) % 1.0) - 1.0)
    reference = np.where(times < 1.0, np.interp(times, [0.4, 1.0], [0.0, 5.0]), height)
    nominal = load_model("paper")
    hidden = nominal.with_block("creep", gains=(0.02,) * 4, time_constants_s=(0.1, 1.0, 10.0, 100.0)).with_block(
        "rate_independent_hysteresis", thresholds_V=(1.5, 4.0, 8.0, 14.0), weights_um_per_V=(0.04, 0.03, 0.03, 0.02)
    )
    device, model = (FollowedPlant(Plant(x), "displacement") for x in (hidden, nominal))
    made = ModelFollower(model, model, Gains(0.01, 5.0, 0.01, 2.0 * period_s), Limits(), period_s, slew_V_per_s=225.0)
    known = begin(reference)
    for _ in range(8):
        profile = Profile(tuple(times.tolist()), tuple(known.target_um.tolist()))
        trace = simulate_following(device, made, profile, Sampling(30.0), 6.0)
        known = learn(known, reference, trace.displacement_um, 0.0)
    assert known.best_error_um < known.errors_um[0] / 20.0
