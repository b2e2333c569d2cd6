"""A sensor as the loop wants it: the newest reading, in µm from the rest position.

A thread reads, as the camera's does, so that a sensor that blocks shows as a stall and not as a loop that stands
still. Readings that nobody fetched are replaced by the next one and counted. A sensor that fails, or gives what is
no reading, is closed and opened anew, and has to be the one that was there at first.
"""

import contextlib
import math
import threading
import time
from numbers import Real
from types import TracebackType
from typing import Self

import numpy as np

from bender_hil.runner.tip_camera import Sight
from bender_hil.sensors.sensor import Reading, Sensor
from bender_hil.sensors.table import ToUm
from bender_hil.supply.parse import Identity
from bender_loop.errors import InputError, RunError

_FIRST_READING_S = 10.0
_WAIT_S = 0.1
_REOPEN_S = 0.1
_CLOSING_S = 3.0
_AHEAD_S = 0.01
_REPEATS = 3
"""So many times the longest row of equal readings at rest is no accident any more: the sensor hangs."""
_WAITED_FOR, _WAITED_FOR_S = 10, 10.0
"""So many times as many readings, and so much longer, while all at rest are equal: a coarse sensor repeats itself."""


class NoSensorError(InputError):
    """The sensor cannot be opened, or something else answers."""


class SensorEyes:
    """A sensor behind the loop's `Eyes`.

    Args:
        sensor: not open yet.
        to_um: from its unit to micrometres; NaN where it is not valid.
        valid: readings outside are none; None for no such bounds.
        repeats_count: whether readings may repeat for ever.
        name: of the sensor and where it is, for messages.

    Attributes:
        identity: what the sensor said of itself, once it is open.
        noise_um: standard deviation at rest, NaN until the rest position has been taken.
        reopened: how often it was opened anew.
    """

    def __init__(
        self,
        sensor: Sensor,
        to_um: ToUm,
        valid: tuple[float, float] | None = None,
        *,
        repeats_count: bool = False,
        name: str = "sensor",
    ) -> None:
        self._sensor, self._to_um, self._valid, self._name = sensor, to_um, valid, name
        self._repeats_count = repeats_count
        self._news = threading.Condition()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._read_for_ever, name="sensor reader", daemon=True)
        self._newest: Reading | None = None
        self._count = self._fetched = self._run = 0
        self._longest_run = 1
        self._fresh_s = time.perf_counter()
        self._rest_um = 0.0
        self._failure = ""
        self.identity: Identity | None = None
        self.noise_um = math.nan
        self.reopened = 0

    def __enter__(self) -> Self:
        """Open the sensor.

        Raises:
            NoSensorError: it cannot be opened, or something else answers.
        """
        try:
            self.identity = self._opened()
        except Exception as error:  # a sensor fails in its own way
            self._close()
            sentence = f"{self._name}: the sensor cannot be opened: {_words(error)}"
            raise NoSensorError(
                sentence if isinstance(error, InputError) else f"{sentence}; is it switched on?"
            ) from error
        self._fresh_s = time.perf_counter()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.set()
        with self._news:
            self._news.notify_all()
        self._thread.join(_CLOSING_S)
        if not self._thread.is_alive():
            self._close()

    def zero(self, count: int) -> float:
        """Take the rest position from the next `count` readings, or more of a sensor whose steps are coarse.

        Raises:
            RunError: there are no readings, none that is valid, or all are the same.
        """
        values_um: list[float] = []
        sight = None
        taken = longest = 0
        end_s = 0.0
        while taken < count or (taken < _WAITED_FOR * count and time.perf_counter() < end_s and self._hangs(values_um)):
            sight = self.look(_WAIT_S)
            if sight is not None:
                taken += 1
                end_s = time.perf_counter() + _WAITED_FOR_S if taken <= count else end_s
                longest = max(longest, self._run)
                values_um += [] if sight.tip_um is None else [sight.tip_um]
            elif self.stalled_s() > _FIRST_READING_S:
                why = f": {self._failure}" if self._failure else "; is it connected?"
                raise RunError(f"the sensor gave {taken} readings, expected {count}{why}")
        if 2 * len(values_um) < taken:
            lost = "" if sight is None or sight.lost is None else f": {sight.lost}"
            raise RunError(f"rest position: {len(values_um)} of {taken} readings are valid{lost}")
        if self._hangs(values_um):
            raise RunError(
                f"rest position: all {len(values_um)} readings are {values_um[-1]:g} µm, without any noise; is the "
                "sensor live? One that has no noise needs sensor.repeats_count = true"
            )
        self._rest_um += float(np.mean(values_um))
        self._longest_run = max(1, longest)
        self.noise_um = float(np.std(values_um))
        # what came meanwhile would be late before the loop begins
        later = self.look(0.0) or sight
        return time.perf_counter() if later is None else later.grabbed_s

    def look(self, timeout_s: float) -> Sight | None:
        """Return the next new reading, None when there was none within `timeout_s`."""
        with self._news:
            self._news.wait_for(lambda: self._count > self._fetched or self._closing.is_set(), timeout_s)
            reading = self._newest
            if self._count == self._fetched or reading is None:
                return None
            skipped, self._fetched = self._count - self._fetched - 1, self._count
            run = self._run
        lost = reading.lost or self._outside(reading.value)
        tip_um = None
        if lost is None:
            tip_um = self._to_um(reading.value) - self._rest_um
            if not math.isfinite(tip_um):
                lost, tip_um = f"{reading.value:g} {self._sensor.unit} is outside the calibration", None
        frozen = 0 if self._repeats_count else run // (_REPEATS * self._longest_run)
        return Sight(self._fetched, reading.time_s, skipped, tip_um, float(lost is None), lost, None, frozen)

    def let_go(self) -> tuple[Sensor, ToUm]:
        """Stop reading, and hand over the sensor with what turns its values into µm from the rest position."""
        self._closing.set()
        self._thread.join(_CLOSING_S)
        return self._sensor, lambda value: self._to_um(value) - self._rest_um

    def stalled_s(self) -> float:
        """Age of the newest reading, or seconds since opening."""
        return time.perf_counter() - self._fresh_s

    @property
    def name(self) -> str:
        """Of the sensor and where it is."""
        return self._name

    def trouble(self) -> str:
        """What the sensor itself raised since its newest reading, empty where it raised nothing."""
        return self._failure

    def why_nothing(self) -> str:
        """What the sensor itself raised, as a sentence."""
        return f"{self._failure}." if self._failure else ""

    def _hangs(self, values_um: list[float]) -> bool:
        return len(set(values_um)) == 1 and not self._repeats_count

    def _outside(self, value: float) -> str | None:
        if not math.isfinite(value):
            return f"it gives {value}"
        if self._valid is None or self._valid[0] <= value <= self._valid[1]:
            return None
        low, high = self._valid
        return f"{value:g} {self._sensor.unit} is outside the valid range, {low:g} ... {high:g}"

    def _read_for_ever(self) -> None:
        while not self._closing.is_set():
            try:
                reading = _judged(self._sensor.read(_WAIT_S))
            except Exception as error:  # a sensor fails in its own way; the time without a reading is what counts
                self._failure = _words(error)
                self._reopen()
                continue
            if reading is not None:
                self._publish(reading)

    def _opened(self) -> Identity:
        identity = self._sensor.open()
        if not isinstance(identity, Identity):
            raise InputError(f"open gave {identity!r:.60}, expected an Identity")
        return identity

    def _close(self) -> None:
        with contextlib.suppress(Exception):  # there is nothing left that could be done about it
            self._sensor.close()

    def _reopen(self) -> None:
        broken = self._failure
        self._close()
        while not self._closing.wait(_REOPEN_S):
            try:
                identity = self._opened()
            except Exception as error:  # as above
                self._failure = f"{broken}; it cannot be opened anew: {_words(error)}"
                self._close()
                continue
            if identity == self.identity:
                self.reopened += 1
                return
            self._failure = f"{broken}; another sensor answers: {' '.join(identity)}"
            self._close()

    def _publish(self, reading: Reading) -> None:
        with self._news:
            before = self._newest
            is_same = before is not None and reading.value == before.value and reading.lost == before.lost
            self._run = self._run + 1 if is_same else 1
            self._newest, self._count = reading, self._count + 1 + reading.passed
            self._fresh_s, self._failure = time.perf_counter(), ""
            self._news.notify_all()


def _judged(found: object) -> Reading | None:
    """Return what a sensor gave; InputError for what is no reading, or one of another clock."""
    if found is None:
        return None
    if not isinstance(found, Reading):
        raise InputError(f"read gave {found!r:.60}, expected a Reading or None")
    if not all(isinstance(number, Real) for number in (found.value, found.time_s)):
        raise InputError(f"read gave {found!r:.120}, expected numbers for value and time_s")
    if (ahead_s := found.time_s - time.perf_counter()) > _AHEAD_S:
        raise InputError(
            f"a reading holds {ahead_s:.3g} s from now, expected a time of time.perf_counter that has been"
        )
    return found


def _words(error: Exception) -> str:
    words = " ".join(str(error).split())
    is_told = words and isinstance(error, OSError | InputError | RunError)
    return words if is_told else f"{type(error).__name__}: {words}"
