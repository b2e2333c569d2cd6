"""Which shaper and horizon a tuning takes of those that it has tried."""

import math
from pathlib import Path

import numpy as np
import pytest
from following_controllers import followed_as

from bender_loop.control.sampling import Sampling
from bender_loop.fmu.followed_model import FollowedModel
from bender_tuner.task.following import MOST_TICKS, Following, Scored, candidates, choose


def scored(rate: float, horizon: int, rms_um: float, value: float = 1.0, kept: bool = True) -> Scored:
    model = followed_as("0" * 64, rate_um_per_s=rate, horizon_ticks=horizon)
    return Scored(Following(model, Path("model.fmu")), value, rms_um, kept)


def model_of(chosen: Scored | None) -> FollowedModel:
    assert chosen is not None
    return chosen.following.model


def test_the_calmest_of_those_that_are_as_near_is_taken():
    quick, calm, slow = scored(600.0, 1, 1.000), scored(200.0, 1, 1.008), scored(100.0, 1, 1.02)
    assert model_of(choose([quick, calm, slow])).rate_um_per_s == 200.0


def test_a_shaper_that_costs_a_tenth_of_the_rms_is_not_calm_but_slow():
    """Most of a step's rms is its dead time: what a shaper adds looks small beside it."""
    quick, slow = scored(300.0, 2, 1.0), scored(100.0, 1, 1.1)
    assert model_of(choose([quick, slow])).rate_um_per_s == 300.0


TRIED = (
    (200.0, 1, 2.6748, 1.6385), (150.0, 1, 2.7750, 1.6190), (120.0, 1, 2.8927, 1.5957), (100.0, 1, 2.9928, 1.6302),
    (60.0, 1, 3.3900, 1.8054), (600.0, 2, 2.5748, 1.6821), (300.0, 2, 2.5748, 1.6821), (200.0, 2, 2.5813, 1.6457),
    (150.0, 2, 2.6236, 1.6134), (120.0, 2, 2.7209, 1.5459), (100.0, 2, 2.8091, 1.5728), (60.0, 2, 3.2075, 1.7326),
)  # fmt: skip
"""Behind a dead time of 120 ms: rate, horizon, rms of the step, objective."""


@pytest.mark.parametrize("seed", range(20))
def test_what_the_noise_of_an_objective_may_decide_costs_no_rms(seed: int):
    noise = np.random.default_rng(seed).normal(0.0, 0.015, len(TRIED))
    tried = [scored(*x[:3], value=x[3] * (1.0 + y)) for x, y in zip(TRIED, noise, strict=True)]
    chosen = choose(tried, plain=1.913)
    assert chosen is not None
    assert chosen.nominal_rms_um < 1.02 * min(x[2] for x in TRIED)


def test_a_longer_horizon_is_taken_only_where_it_helps():
    assert model_of(choose([scored(600.0, 2, 1.0), scored(600.0, 1, 1.01)])).horizon_ticks == 1


@pytest.mark.parametrize(("slow_kept", "known"), [(True, 1), (False, 2)])
def test_a_known_reference_has_the_shortest_horizon_that_keeps_the_bounds_at_all(slow_kept: bool, known: int):
    tried = [scored(600.0, 1, 0.7, kept=False), scored(100.0, 1, 1.3, kept=slow_kept), scored(300.0, 2, 1.0)]
    model = model_of(choose(tried))
    assert (model.horizon_ticks, model.preview_horizon_ticks) == (2, known)


def test_a_known_reference_takes_no_horizon_that_is_worse_than_the_block_alone():
    tried = [scored(100.0, 2, 9.0, value=5.0), scored(100.0, 8, 1.0)]
    model = model_of(choose(tried, plain=2.0))
    assert (model.horizon_ticks, model.preview_horizon_ticks) == (8, 8)


def test_what_breaks_a_bound_or_is_worse_with_a_wrong_gain_is_not_taken():
    broken, fragile, sound = scored(600.0, 1, 0.5, kept=False), scored(300.0, 1, 0.6, value=1.2), scored(60.0, 1, 1.0)
    assert model_of(choose([broken, fragile, sound])).rate_um_per_s == 60.0
    assert choose([broken, scored(1.0, 1, 1.0, value=math.inf)]) is None


@pytest.mark.parametrize(("lag_s", "longest"), [(0.0, 2), (0.03, 2), (0.2, 8), (50.0, MOST_TICKS)])
def test_horizons_grow_up_to_the_lag_of_the_plant(lag_s: float, longest: int):
    groups = list(candidates(followed_as("0" * 64), Path("model.fmu"), 10.0, Sampling(50.0), lag_s))
    horizons = [{x.model.horizon_ticks for x in group} for group in groups]
    assert horizons[0] == {1, 2}
    assert [max(x) for x in horizons] == [2 * 2**k for k in range(len(groups))]
    assert max(horizons[-1]) == longest


def test_what_is_no_better_than_the_block_alone_is_none():
    assert choose([scored(100.0, 1, 1.0, value=2.0)], plain=2.0) is None
