"""Models that a controller follows: the dead time of a plant, and the controller of a gains file around its models."""

from pathlib import Path

import pytest
from following_controllers import followed_as
from tests.test_loop.test_model_following import Lag

from bender_loop.control.pid import Gains, Limits
from bender_loop.fmu.followed_model import Loop, follower_of
from bender_loop.fmu.following_models import FollowingModels, dead_time_of


class LatePlay:
    """0.5 um/V behind a dead time of whole milliseconds and a play."""

    def __init__(self, dead_ms: int, half_um: float) -> None:
        self.dead_ms, self.half_um = dead_ms, half_um
        self.reset()

    def reset(self) -> None:
        self.queue, self.y, self.pushed = [0.0] * self.dead_ms, 0.0, 0.0

    def read(self) -> float:
        return self.y

    def step(self, voltage_V: float, step_s: float) -> float:
        assert step_s == 1e-3
        self.queue.append(voltage_V)
        self.pushed += 0.2 * (0.5 * self.queue.pop(0) - self.pushed)
        self.y = min(max(self.y, self.pushed - self.half_um), self.pushed + self.half_um)
        return self.y


@pytest.mark.parametrize("dead_ms", [0, 12])
@pytest.mark.parametrize("half_um", [0.0, 0.49999, 1.6])
def test_a_play_is_no_dead_time(dead_ms: int, half_um: float):
    assert dead_time_of(LatePlay(dead_ms, half_um), 1.0) == pytest.approx(1e-3 * dead_ms, abs=1e-9)  # pyright: ignore[reportArgumentType]


def test_a_plant_that_never_answers_has_none():
    assert dead_time_of(LatePlay(0, 1e9), 1.0) == 0.0  # pyright: ignore[reportArgumentType]


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
