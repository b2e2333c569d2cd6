"""From the tip to what the sensor's electronics see: averaging, saturation, noise, and what is wrong with it."""

import math
import threading
import time
from collections import deque

import numpy as np

from bender_emulator.faults import Faults
from bender_emulator.sensors.settings import SensorEmulation

_KEPT_STEPS = 4000


class Transducer:
    """Where the tip was during the last seconds, as a sensor would say it.

    Args:
        settings: of the sensor.
        rng: of its noise.

    Attributes:
        faults: what is wrong at present.
        lock: to be held where they are changed.
    """

    def __init__(self, settings: SensorEmulation, rng: np.random.Generator) -> None:
        self.settings, self._rng = settings, rng
        self.lock = threading.RLock()
        self.faults = Faults()
        self._track: deque[tuple[float, float]] = deque([(-math.inf, 0.0)], maxlen=_KEPT_STEPS)
        self._frozen_um: float | None = None

    def follow(self, time_s: float, tip_um: float) -> None:
        """Take where the tip is; called by the physics with every step."""
        self._track.append((time_s, tip_um))

    def reading_um(self) -> float:
        """Return the mean over the aperture that ends now, with noise; infinite where the sensor is saturated."""
        now_s = time.perf_counter()
        begin_s = now_s - self.settings.aperture_s
        track = list(self._track)
        values = [tip_um for time_s, tip_um in reversed(track) if time_s >= begin_s] or [track[-1][1]]
        (reading_um,) = self._as_sensed([float(np.mean(values))], 1.0)
        return reading_um

    def samples_um(self, begin_s: float, end_s: float, count: int) -> list[float]:
        """Return `count` samples between two times; the mean of all of them has the noise of a reading."""
        times_s, places_um = np.array(list(self._track)).T
        at_s = np.linspace(begin_s, end_s, count)
        latest = np.searchsorted(times_s, at_s, side="right") - 1
        return self._as_sensed(places_um[np.maximum(latest, 0)].tolist(), math.sqrt(count))

    def _as_sensed(self, true_um: list[float], noise_times: float) -> list[float]:
        settings, faults = self.settings, self.faults
        noise_um = noise_times * (settings.noise_um + faults.noise_um)
        with self.lock:
            if not faults.frozen:
                self._frozen_um = None
            elif self._frozen_um is None:
                self._frozen_um = true_um[-1] + faults.travel_um
            if self._frozen_um is not None:
                return [self._frozen_um] * len(true_um)
            noise = self._rng.standard_normal(len(true_um))
        moved = [place_um + faults.travel_um + noise_um * float(x) for place_um, x in zip(true_um, noise, strict=True)]
        return [x if abs(x) <= settings.range_um else math.copysign(math.inf, x) for x in moved]
