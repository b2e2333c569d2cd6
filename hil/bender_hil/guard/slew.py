"""The slew limit as a bucket of volts: it fills with time, each change takes from it, in either direction.

Over any time the output changes by at most slew times (time + burst), and no single change is larger than slew times
burst. Commands that come a little early, because frames do, still pass whole.
"""


class SlewLimit:
    """State of one bucket, full at the start.

    Args:
        slew_V_per_s: how fast it fills.
        burst_s: how much fits in: slew times this.
        now_s: the time.
    """

    def __init__(self, slew_V_per_s: float, burst_s: float, now_s: float) -> None:
        self._slew_V_per_s = slew_V_per_s
        self._capacity_V = slew_V_per_s * burst_s
        self._level_V, self._filled_s = self._capacity_V, now_s

    def allowed(self, present_V: float, wanted_V: float, now_s: float) -> float:
        """The voltage nearest to `wanted_V` that may be set now."""
        self._fill(now_s)
        change_V = max(-self._level_V, min(self._level_V, wanted_V - present_V))
        return present_V + change_V

    def take(self, change_V: float) -> None:
        """A change was made."""
        self._level_V = max(0.0, self._level_V - abs(change_V))

    def _fill(self, now_s: float) -> None:
        gained_V = self._slew_V_per_s * (now_s - self._filled_s)
        self._level_V, self._filled_s = min(self._capacity_V, self._level_V + gained_V), now_s
