"""A run without a loop: the source plays a profile by its own clock, the sensor records by the same clock.

Reading k is taken at the very edge at which level k begins, so a record has no jitter and no delay of this computer in
it. The controller only looks on: it writes down what comes and ends the run where the tip leaves its limits, which it
sees some milliseconds later than in a loop.
"""

import math
import time
from dataclasses import dataclass
from typing import Any, Protocol, TypeGuard

from bender_hil.guard.rules import Trip
from bender_hil.log.journal import Journal
from bender_hil.runner.interrupts import Interrupts
from bender_hil.runner.loop import LoopEnd
from bender_hil.runner.program import OpenLoop
from bender_hil.sensors.sensor import Sensor
from bender_hil.sensors.sensor_eyes import SensorEyes
from bender_loop.errors import RunError

_PATIENCE_S = 0.02


class Recording(Protocol):
    """Samples that come by the clock of the source."""

    def read(self, timeout_s: float) -> list[float]:
        """Return the samples that have come since, NaN for one that is none."""
        ...


class RecordingSensor(Sensor, Protocol):
    """A sensor that records by the clock of the source."""

    def record(self, rate_Hz: float, count: int) -> Recording:
        """Wait for the source's clock, and take so many samples by it."""
        ...


class PlayingGuard(Protocol):
    """What a run without a loop needs of a guard."""

    def play(self, levels_V: list[float], rate_Hz: float) -> float | None:
        """Let the source play; returns when it began, None where the run has ended."""
        ...

    def beat(self) -> None:
        """Say that the controller is alive."""
        ...

    def trip(self, code: str, sentence: str) -> None:
        """End the run."""
        ...

    def has_tripped(self) -> bool:
        """Whether the guard has ended the run."""
        ...


def can_record(sensor: object) -> TypeGuard[RecordingSensor]:
    """Whether a sensor records by the clock of the source."""
    return hasattr(sensor, "record")


@dataclass(slots=True)
class Buffered(OpenLoop):
    """A profile that the source plays by itself.

    Attributes:
        rate_Hz: levels per second.
    """

    rate_Hz: float

    @property
    def levels_V(self) -> list[float]:
        """What is played, level by level."""
        return [self.voltages.at(place / self.rate_Hz) for place in range(round(self.duration_s * self.rate_Hz))]

    def facts(self) -> dict[str, Any]:
        """The profile, as that of a loop that plays it."""
        return OpenLoop.facts(self) | {"buffered_Hz": self.rate_Hz}


class BufferedLoop:
    """One run of a profile that the source plays by itself.

    Args:
        eyes: zeroed.
        guard: ready.
        program: the profile.
        journal: every reading is written there.
        travel_um: where the tip may be.
        stall_s: readings that come no more for so long end the run.
        interrupts: whose signal ends it.
    """

    def __init__(
        self,
        eyes: SensorEyes,
        guard: PlayingGuard,
        program: Buffered,
        journal: Journal,
        travel_um: tuple[float, float],
        stall_s: float,
        interrupts: Interrupts,
    ) -> None:
        self._eyes, self._guard, self._program, self._journal = eyes, guard, program, journal
        self._travel_um, self._stall_s, self._interrupts = travel_um, stall_s, interrupts
        self._ticks = 0

    def run(self, zeroed_s: float) -> LoopEnd:  # noqa: ARG002
        """Until the profile has been recorded or something ends it; ClosedError when the guard has gone."""
        sensor, to_um = self._eyes.let_go()
        if not can_record(sensor):
            raise RunError("the sensor does not record by the clock of the source")
        levels_V = self._program.levels_V
        recording = sensor.record(self._program.rate_Hz, len(levels_V))
        start_s = self._guard.play(levels_V, self._program.rate_Hz)
        heard_s = time.perf_counter()
        while start_s is not None and self._ticks < len(levels_V) and not self._guard.has_tripped():
            if (signal := self._interrupts.signal) is not None:
                return self._end(Trip("interrupted", f"{signal} was sent to the controller"))
            values = recording.read(_PATIENCE_S)
            self._guard.beat()
            for value in values[: len(levels_V) - self._ticks]:
                trip = self._take(start_s, to_um(value), levels_V[self._ticks])
                if trip is not None:
                    return self._end(trip)
            heard_s = time.perf_counter() if values else heard_s
            if time.perf_counter() - heard_s > self._stall_s:
                sentence = f"no samples for {1e3 * self._stall_s:.0f} ms: the sensor does not hear the source's clock"
                return self._end(Trip("camera_stalled", sentence))
        return LoopEnd(self._ticks, None)

    def _take(self, start_s: float, tip_um: float, level_V: float) -> Trip | None:
        place, rate_Hz = self._ticks, self._program.rate_Hz
        at_s, found_um = start_s + place / rate_Hz, tip_um if math.isfinite(tip_um) else None
        self._journal.write(
            "tick",
            sequence=place,
            frame=place,
            grabbed_s=at_s,
            time_s=place / rate_Hz,
            dt_s=1.0 / rate_Hz,
            measured_um=found_um,
            confidence=float(found_um is not None),
            lost=None if found_um is not None else "out of range",
            setpoint_um=None,
            command_V=level_V,
            sent_s=at_s,
            skipped=0,
            late=False,
        )
        self._ticks += 1
        low_um, high_um = self._travel_um
        if found_um is not None and not low_um <= found_um <= high_um:
            return Trip("travel", f"the tip is at {found_um:.2f} µm, allowed: {low_um:g} ... {high_um:g} µm")
        return None

    def _end(self, trip: Trip) -> LoopEnd:
        self._guard.trip(trip.code, trip.sentence)
        self._journal.write("ended_by_controller", code=trip.code, sentence=trip.sentence)
        return LoopEnd(self._ticks, trip)
