"""Does the picture answer the command? Two checks of the controller against a picture that is no longer live.

The first looks at the content around the wire and finds a frozen or torn stream within three frames. The second asks
what the model expects: a tip that stays within its noise while the command has gone so far that the tip must have
moved many times its noise is not the tip that the command moves. It finds what the first cannot see, such as a
recording with noise of its own, a wire that has come off or an actuator that is not connected. Where the command stands
still, nothing is expected and nothing is found.

A third one is for sensors that are no camera: one whose readings scatter far more than at rest, while the command
stands still, has a broken cable or an amplifier at its end.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from itertools import pairwise

from bender_hil.guard.rules import Trip
from bender_hil.recent_range import RecentRange
from bender_hil.runner.program import Decision
from bender_hil.runner.tip_camera import Sight

SETTLE_S = 0.5
"""A command counts once it has held for so long: longer than any dead time of the catalogue of effects (0.3 s)."""
NOISES = 6.0
RESTING_V = 0.5
MOST_NOISES, LEAST_SHARE = 20.0, 0.02
"""Scatter that is too much: so many times that at rest, and at the least this share of the travel."""
_READINGS = 20
LEAST_NOISE_UM = 0.02
FROZEN_PICTURE = "the picture around the wire has not changed for {} frames"
FROZEN_READING = "the reading has not changed for {} times as long as a live one may stay the same"


class FrozenCheck:
    """Ends a run when the picture around the wire, or the reading of a sensor, does not change any more.

    Args:
        allowed: so many in a row may repeat the one before.
        sentence: for the message, with `{}` for how many did.
    """

    def __init__(self, allowed: int, sentence: str = FROZEN_PICTURE) -> None:
        self._allowed, self._sentence = allowed, sentence

    def see(self, sight: Sight, decision: Decision) -> Trip | None:  # noqa: ARG002
        """Take a tick."""
        if sight.frozen <= self._allowed:
            return None
        return Trip("frozen", f"{self._sentence.format(sight.frozen)}, allowed: {self._allowed}")


class AnswerCheck:
    """Ends a run when the tip does not answer commands that must move it.

    Args:
        response_um_per_V: how far the tip moves per volt, at the least; 0 expects nothing.
        slack_V: so far the command may go without any motion: dead zone and play.
        noise_um: gives the standard deviation of the tip at rest, known once the rest position has been taken.
    """

    def __init__(self, response_um_per_V: float, slack_V: float, noise_um: Callable[[], float]) -> None:
        self._response_um_per_V, self._slack_V, self._noise_um = response_um_per_V, slack_V, noise_um
        self._commands = RecentRange(SETTLE_S)
        self._place_um = self._place_V = 0.0

    def see(self, sight: Sight, decision: Decision) -> Trip | None:
        """Take a tick."""
        now_s, tip_um = sight.grabbed_s, sight.tip_um
        gone_V = self._gone_V(now_s)
        self._commands.add(now_s, decision.voltage_V)
        if tip_um is None:
            return None
        band_um = NOISES * max(LEAST_NOISE_UM, self._noise_um())
        if abs(tip_um - self._place_um) > band_um:
            self._place_um, self._place_V = tip_um, decision.voltage_V
            return None
        expected_um = self._response_um_per_V * (gone_V - self._slack_V)
        if expected_um <= 2.0 * band_um:
            return None
        return Trip(
            "unanswered",
            f"the tip moved less than {band_um:.2f} µm while the command went {gone_V:.1f} V, which moves it by "
            f"{expected_um:.2f} µm at the least (controller.response_um_per_V); is the picture live, the actuator "
            "connected?",
        )

    def _gone_V(self, now_s: float) -> float:
        """How far the command has been away, for all of the settling time, from where the tip last moved."""
        if self._commands.since_s(now_s) > now_s - SETTLE_S:
            return 0.0
        low_V, high_V = (level_V - self._place_V for level_V in self._commands.range(now_s))
        return 0.0 if low_V < 0.0 < high_V else min(abs(low_V), abs(high_V))


class NoiseCheck:
    """Ends a run when the readings scatter far more than at rest while the command has stood still.

    The scatter is that of second differences, over the root of six: a slow motion leaves nothing in it.

    Args:
        travel_um: how far the tip may go.
        noise_um: gives the standard deviation of the tip at rest.
    """

    def __init__(self, travel_um: float, noise_um: Callable[[], float]) -> None:
        self._least_um, self._noise_um = LEAST_SHARE * travel_um, noise_um
        self._readings: deque[float] = deque(maxlen=_READINGS)
        self._low_V = self._high_V = 0.0
        self._still_since_s = 0.0

    def see(self, sight: Sight, decision: Decision) -> Trip | None:
        """Take a tick."""
        voltage_V = decision.voltage_V
        self._low_V, self._high_V = min(self._low_V, voltage_V), max(self._high_V, voltage_V)
        if self._high_V - self._low_V > RESTING_V:
            self._low_V = self._high_V = voltage_V
            self._still_since_s = sight.grabbed_s
        if sight.tip_um is None or sight.grabbed_s - self._still_since_s < SETTLE_S:
            self._readings.clear()
            return None
        self._readings.append(sight.tip_um)
        if len(self._readings) < _READINGS:
            return None
        scatter_um = _scatter(self._readings)
        most_um = max(MOST_NOISES * self._noise_um(), self._least_um)
        if scatter_um <= most_um:
            return None
        sentence = f"the readings scatter by {scatter_um:.2f} µm at a still command, allowed: {most_um:.2f} µm"
        return Trip("noise", sentence)


def _scatter(readings: Sequence[float]) -> float:
    """Return the standard deviation of second differences over the root of six; without arrays, at every tick."""
    first = [after - before for before, after in pairwise(readings)]
    second = [after - before for before, after in pairwise(first)]
    mean = sum(second) / len(second)
    return math.sqrt(sum((value - mean) ** 2 for value in second) / (6.0 * len(second)))
