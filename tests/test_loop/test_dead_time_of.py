"""The dead time of a plant, found from its answers to steps."""

import pytest

from bender_loop.fmu.following_models import dead_time_of


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
