"""What can go wrong with the emulated camera, switched on for a while."""

import math
import threading
import time

STALL, DROP, BLACK, WHITE, FREEZE, AWAY, GARBLE = "stall", "drop", "black", "white", "freeze", "away", "garble"
CLOCK, TORN, RECORDING = "clock", "torn", "recording"
FAULTS = {
    STALL: "no frame is sent, the link stays",
    DROP: "the link is cut and new ones are refused",
    BLACK: "the lamp is off",
    WHITE: "the sensor is saturated",
    FREEZE: "the same picture again and again",
    AWAY: "the tip is out of view",
    GARBLE: "bytes of the stream are replaced",
    CLOCK: "the same picture again and again, but a clock in its corner goes on",
    TORN: "the upper quarter of the picture is new, the rest is that of the picture before",
    RECORDING: "the tip stays where it was seen, with new noise",
}


class Faults:
    """The faults that are on; safe between threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._until_s: dict[str, float] = {}

    def set(self, name: str, duration_s: float = math.inf) -> None:
        """Switch a fault on, for ever or for a while.

        Raises:
            ValueError: there is no such fault, or the duration is no positive number.
        """
        if name not in FAULTS:
            raise ValueError(f"fault: found {name!r}, expected one of {', '.join(FAULTS)}")
        if not duration_s > 0.0:
            raise ValueError(f"duration: found {duration_s}, expected seconds above 0")
        with self._lock:
            self._until_s[name] = time.perf_counter() + duration_s

    def clear(self) -> None:
        """Switch every fault off."""
        with self._lock:
            self._until_s.clear()

    def active(self) -> frozenset[str]:
        """The faults that are on now."""
        now = time.perf_counter()
        with self._lock:
            for name in [name for name, until in self._until_s.items() if until <= now]:
                del self._until_s[name]
            return frozenset(self._until_s)
