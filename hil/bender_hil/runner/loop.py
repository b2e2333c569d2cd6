"""The loop: a frame comes, the tip is found, the programme decides, the guard is told. The camera is the clock."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from bender_hil.guard.rules import Trip
from bender_hil.log.journal import Journal
from bender_hil.runner.frames import FrameRing
from bender_hil.runner.interrupts import Interrupts
from bender_hil.runner.program import Decision, HearsWhenItActs, Program
from bender_hil.runner.tip_camera import Eyes, Sight
from bender_loop.errors import RunError

_PATIENCE_S = 0.02
CONTROLLER_FAILED = "controller_failed"
"""The code of a run whose programme could not say what to do."""

Witness = Callable[[Sight], None]


class Commanded(Protocol):
    """What the loop needs of a guard."""

    def command(self, sequence: int, voltage_V: float, frame_s: float, tip_um: float | None) -> None:
        """Command a voltage."""
        ...

    def beat(self) -> None:
        """Say that the loop is alive."""
        ...

    def trip(self, code: str, sentence: str) -> None:
        """End the run."""
        ...

    def has_tripped(self) -> bool:
        """Whether the guard has ended the run."""
        ...


class Check(Protocol):
    """A rule that the controller holds itself to, beside those of the guard."""

    def see(self, sight: Sight, decision: Decision) -> Trip | None:
        """Take a tick; returns the reason for an end, None when all is well."""
        ...


@dataclass(frozen=True, slots=True)
class LoopSettings:
    """The camera's side of the loop.

    Attributes:
        deadline_s: from the instant of a frame until its command is late.
        frame_age_s: a camera silent for longer has stalled.
        delay_s: age of a picture when it is grabbed, taken off the times in the log.
    """

    deadline_s: float
    frame_age_s: float
    delay_s: float = 0.0


class LoopEnd(NamedTuple):
    """How the loop ended: ticks done, and the reason that the controller gave, None where it had none."""

    ticks: int
    trip: Trip | None


def command_delay_s(grabbed_s: float, sent_s: float, picture_delay_s: float) -> float:
    """Return how long after the light of a frame its command went to the supply."""
    return sent_s - grabbed_s + picture_delay_s


class ControlLoop:
    """One run of a programme.

    Args:
        eyes: zeroed.
        guard: ready.
        program: what to do.
        journal: every tick is written there.
        ring: keeps the newest frames.
        settings: of the loop.
        witness: is shown every sight after its command has gone, for measurements from outside.
        interrupts: whose signal ends the loop.
        checks: rules that see every tick.
    """

    def __init__(
        self,
        eyes: Eyes,
        guard: Commanded,
        program: Program,
        journal: Journal,
        ring: FrameRing,
        settings: LoopSettings,
        witness: Witness | None = None,
        interrupts: Interrupts | None = None,
        checks: Sequence[Check] = (),
    ) -> None:
        self._eyes, self._guard, self._program, self._journal = eyes, guard, program, journal
        self._ring, self._settings, self._witness = ring, settings, witness
        self._start_s: float | None = None
        self._ticks = 0
        self._hears = program.acted if isinstance(program, HearsWhenItActs) else None
        self._interrupts = Interrupts() if interrupts is None else interrupts
        self._checks = checks

    def run(self, zeroed_s: float) -> LoopEnd:
        """Until the programme is over or something ends it.

        Args:
            zeroed_s: when the last frame before the run was grabbed.

        Raises:
            ClosedError: the guard has gone.
        """
        before_s = zeroed_s
        while not self._guard.has_tripped():
            if (signal := self._interrupts.signal) is not None:
                return self._end(Trip("interrupted", f"{signal} was sent to the controller"))
            sight = self._eyes.look(_PATIENCE_S)
            if sight is None:
                age_s, allowed_s = self._eyes.stalled_s(), self._settings.frame_age_s
                if age_s > allowed_s:
                    sentence = f"no reading for {1e3 * age_s:.0f} ms, allowed: {1e3 * allowed_s:.0f} ms"
                    return self._end(Trip("camera_stalled", sentence))
                self._guard.beat()
                continue
            if sight.grabbed_s <= before_s:
                continue
            if self._start_s is None:
                self._start_s = sight.grabbed_s
            if sight.grabbed_s - self._start_s >= self._program.duration_s:
                return LoopEnd(self._ticks, None)
            trip = self._tick(sight, sight.grabbed_s - self._start_s, sight.grabbed_s - before_s)
            if trip is not None:
                return self._end(trip)
            before_s = sight.grabbed_s
        return LoopEnd(self._ticks, None)

    def _tick(self, sight: Sight, time_s: float, dt_s: float) -> Trip | None:
        try:
            decision = self._program.decide(time_s, dt_s, sight.tip_um)
        except RunError as error:
            return Trip(CONTROLLER_FAILED, str(error))
        self._guard.command(self._ticks, decision.voltage_V, sight.grabbed_s, sight.tip_um)
        sent_s = time.perf_counter()
        if self._hears is not None:
            self._hears(command_delay_s(sight.grabbed_s, sent_s, self._settings.delay_s))
        self._journal.write(
            "tick",
            sequence=self._ticks,
            frame=sight.number,
            grabbed_s=sight.grabbed_s,
            time_s=time_s,
            dt_s=dt_s,
            measured_um=sight.tip_um,
            confidence=sight.confidence,
            lost=sight.lost,
            setpoint_um=decision.setpoint_um,
            command_V=decision.voltage_V,
            **({} if decision.aim_um is None else {"aim_um": decision.aim_um}),
            sent_s=sent_s,
            skipped=sight.skipped,
            late=sent_s - sight.grabbed_s > self._settings.deadline_s,
        )
        self._ticks += 1
        self._ring.add(sight)
        trip = next((found for check in self._checks if (found := check.see(sight, decision)) is not None), None)
        if self._witness is not None:
            self._witness(sight)
        return trip

    def _end(self, trip: Trip) -> LoopEnd:
        self._guard.trip(trip.code, trip.sentence)
        self._journal.write("ended_by_controller", code=trip.code, sentence=trip.sentence)
        return LoopEnd(self._ticks, trip)
