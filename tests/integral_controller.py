"""A controller that forgets nothing, for loops around hidden benches."""

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Integral:
    """It integrates towards what it aims at, between 0 and 50 V; of negative gain it runs away from there."""

    gain_V_per_um: float
    aim_um: Callable[[float], float] = lambda _: 10.0
    change_V: float = math.inf

    def rest(self) -> float:
        return 0.0

    def step(self, state: float, time_s: float, reading_um: float) -> tuple[float, float]:
        wanted_V = state + self.gain_V_per_um * (self.aim_um(time_s) - reading_um)
        after = min(max(wanted_V, state - self.change_V, 0.0), state + self.change_V, 50.0)
        return after, after
