"""Iterative learning on plants whose error from pass to pass is known."""

import numpy as np
import pytest
from tests.test_loop.test_model_following import PERIOD_S, Lag, follower

from bender_loop.control.following_loop import simulate_following
from bender_loop.control.learning import begin, learn, smooth
from bender_loop.control.pid import Limits
from bender_loop.control.references import Profile
from bender_loop.control.sampling import Sampling

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


def test_the_smoothing_shifts_nothing_and_keeps_a_straight_line():
    line = np.linspace(0.0, 3.0, 40)
    assert smooth(line)[1:-1] == pytest.approx(line[1:-1])
    pulse = np.zeros(21)
    pulse[10] = 1.0
    assert smooth(pulse) == pytest.approx(smooth(pulse)[::-1])


def test_a_scan_through_a_wrong_model_is_learned_within_eight_passes():
    times = np.arange(REFERENCE.size) * PERIOD_S
    known, made = begin(REFERENCE), follower(3, shaper=None, limits=Limits(-50.0, 50.0))
    sampling = Sampling(1.0 / PERIOD_S)
    for _ in range(8):
        profile = Profile(tuple(times.tolist()), tuple(known.target_um.tolist()))
        device = Lag(gain=0.42, lag_s=0.1, dead_steps=3)
        trace = simulate_following(device, made, profile, sampling, times[-1], dead_time_s=0.03)
        known = learn(known, REFERENCE, trace.displacement_um[: REFERENCE.size], 0.0)
    assert known.best_error_um < known.errors_um[0] / 20.0
