"""When the next reading is due: absolute deadlines, so that a late one delays none after it."""

import time

_LONGEST_SLEEP_S = 0.05


class Pace:
    """Deadlines `1 / rate_Hz` apart; those that have passed are skipped.

    Args:
        rate_Hz: how many a second.
    """

    def __init__(self, rate_Hz: float) -> None:
        self._period_s = 1.0 / rate_Hz
        self._due_s = time.perf_counter()

    def wait(self, timeout_s: float) -> bool:
        """Sleep until the next deadline; False when it does not come within `timeout_s`."""
        end_s = time.perf_counter() + timeout_s
        while (now_s := time.perf_counter()) < self._due_s:
            if now_s >= end_s:
                return False
            time.sleep(min(self._due_s - now_s, end_s - now_s, _LONGEST_SLEEP_S))
        missed = int((now_s - self._due_s) / self._period_s)
        self._due_s += (missed + 1) * self._period_s
        return True
