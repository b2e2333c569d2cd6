"""The controller of a gains file around its models."""

from pathlib import Path

import pytest
from following_controllers import followed_as
from tests.test_loop.test_model_following import Lag

from bender_loop.control.pid import Gains, Limits
from bender_loop.fmu.followed_model import Loop, follower_of
from bender_loop.fmu.following_models import FollowingModels


@pytest.mark.parametrize(
    ("preview", "said", "horizon"), [(False, 1, 2), (True, 1, 1), (True, 0, 2)], ids=["steps", "known", "not said"]
)
def test_a_known_reference_is_not_shaped_and_has_its_own_horizon(preview: bool, said: int, horizon: int):
    model = followed_as("0" * 64, horizon_ticks=2, preview_horizon_ticks=said, held_back=0.03)
    models = FollowingModels(Path("model.fmu"), Lag(), Lag(), 0.0, 0.0)  # pyright: ignore[reportArgumentType]
    made = follower_of(model, models, Gains(0.0, 1.0), Loop(0.05, Limits(), 225.0, preview=preview))
    assert made.horizon_ticks == horizon
    assert (made.shaper is None) == preview
    assert made.held_back == (0.0 if preview else 0.03)


def test_nothing_is_held_back_that_no_integral_would_give():
    model = followed_as("0" * 64, held_back=0.03)
    models = FollowingModels(Path("model.fmu"), Lag(), Lag(), 0.0, 0.0)  # pyright: ignore[reportArgumentType]
    assert follower_of(model, models, Gains(0.0, 0.0), Loop(0.05, Limits(), 225.0)).held_back == 0.0
