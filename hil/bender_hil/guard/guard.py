"""The guard's course: open, arm, watch, come down. It ends in one way only."""

import contextlib
import math
import sys
import time
from enum import IntEnum
from typing import Any, TypeGuard

from bender_hil.guard.descent import Landing, descend
from bender_hil.guard.output import GuardedOutput
from bender_hil.guard.rules import Situation, Trip, judge
from bender_hil.guard.settings import GuardSettings
from bender_hil.log.journal import GuardJournal
from bender_hil.supply.failures import SupplyError, WrongInstrumentError
from bender_hil.supply.source import Source
from bender_hil.wire import Channel, ClosedError, Message
from bender_loop.errors import InputError

_WAIT_S = 0.01
_ALIVE_S = 0.2
_IDLE_S = 0.05
"""A supply that is given no commands is looked after all the same."""
_UNTIL_FIRST_COMMAND_S = 30.0
"""The heartbeat counts from the first command; until then the output is at 0 V and the rest position is taken."""
UNKNOWN = "OUTPUT STATE UNKNOWN: press OUTPUT OFF at the front panel of the supply, or unplug it"


class Status(IntEnum):
    """Exit statuses of a guard."""

    DONE = 0
    TRIPPED = 1
    REFUSED = 2
    UNCONFIRMED = 3


class Guard:
    """One run's guard.

    Args:
        source: the supply, not open yet.
        limits: what to hold the run to.
        channel: to the controller.
        journal: of the guard.
    """

    def __init__(self, source: Source, limits: GuardSettings, channel: Channel, journal: GuardJournal) -> None:
        self._source, self._limits, self._channel, self._journal = source, limits, channel, journal
        self._situation = Situation()
        self._output: GuardedOutput | None = None
        self._stopped = False
        self._said_s = 0.0
        self.signal: str | None = None
        """Set by a signal handler, at any time."""

    def run(self) -> Status:
        """Until the end, whatever ends it."""
        refusal = self._open()
        if refusal is not None:
            return refusal
        try:
            trip = self._arm() or self._watch()
        except SupplyError as error:
            trip = Trip("supply", str(error))
        except ClosedError:
            trip = Trip("controller_gone", "the controller has gone")
        except Exception as error:  # whatever it is, the output has to come down
            trip = Trip("guard", f"a fault in the guard itself: {type(error).__name__}: {error}")
        return self._come_down(trip)

    def _open(self) -> Status | None:
        """Nothing is switched before the right instrument has answered."""
        try:
            identity = self._source.open()
        except (InputError, WrongInstrumentError) as error:
            return self._refuse(Status.REFUSED, str(error))
        except SupplyError as error:
            return self._refuse(Status.TRIPPED, f"{error}; is it switched on, and is nothing else connected to it?")
        self._journal.write("opened", **identity._asdict(), emulated=identity.is_emulated)
        self._identity = identity
        return None

    def _arm(self) -> Trip | None:
        try:
            remarks = self._source.arm(self._limits.bounds())
        except ValueError as error:
            return Trip("limits", str(error))
        self._journal.write("armed", remarks=remarks)
        self._situation.beat_s = time.perf_counter() + _UNTIL_FIRST_COMMAND_S
        self._output = GuardedOutput(self._source, self._limits, self._journal, self._situation)
        self._tell("ready", identity=self._identity._asdict(), emulated=self._identity.is_emulated, remarks=remarks)
        return None

    def _watch(self) -> Trip | None:
        output = self._output
        while output is not None and not self._stopped:
            message = self._channel.receive(_WAIT_S)
            self._say_alive()
            trip = self._take(message, output) if message is not None else None
            if trip is None and self.signal is not None:
                trip = Trip("signal", f"{self.signal} was sent to the guard")
            if trip is None and self._journal.failure is not None:
                trip = Trip("journal", f"the guard's journal cannot be written: {self._journal.failure}")
            if trip is None:
                output.continue_slew()
                if output.idle_s() > _IDLE_S:
                    trip = output.patrol(self._channel.has_message)
                self._situation.now_s = time.perf_counter()
                trip = trip or judge(self._limits, self._situation)
            if trip is not None:
                return trip
        return None

    def _say_alive(self) -> None:
        now_s = time.perf_counter()
        if now_s - self._said_s > _ALIVE_S:
            self._said_s = now_s
            self._channel.send({"say": "alive"})

    def _take(self, message: Message, output: GuardedOutput) -> Trip | None:
        is_command = message.get("do") == "command"
        if is_command or self._situation.frame_s is not None:
            self._situation.beat_s = time.perf_counter()
        match message.get("do"):
            case "command":
                return self._command(message, output)
            case "beat":
                return None
            case "trip":
                return Trip(str(message.get("code")), str(message.get("sentence")))
            case "stop":
                self._stopped = True
                return None
            case other:
                return Trip("bad_command", f"the controller said {other!r}, which is no order")

    def _command(self, message: Message, output: GuardedOutput) -> Trip | None:
        wanted_V, frame_s, tip_um = message.get("voltage_V"), message.get("frame_s"), message.get("tip_um")
        if not (_is_finite(wanted_V) and _is_finite(frame_s) and (tip_um is None or _is_finite(tip_um))):
            return Trip("bad_command", f"the controller commanded {wanted_V!r} V at {tip_um!r} um, {frame_s!r} s")
        situation = self._situation
        situation.frame_s = frame_s
        situation.lost = situation.lost + 1 if tip_um is None else 0
        situation.tip_um = tip_um
        situation.now_s = time.perf_counter()
        trip = judge(self._limits, situation)
        if trip is not None:
            return trip
        sequence = int(message.get("sequence", -1))
        if self._channel.has_message():
            # the loop is ahead of the supply: a command that another one follows already is not worth its time
            self._journal.write("superseded", sequence=sequence, wanted_V=wanted_V)
            return None
        output.command(wanted_V, sequence)
        return output.patrol(self._channel.has_message)

    def _come_down(self, trip: Trip | None) -> Status:
        output = self._output
        counts = {} if output is None else {"clamped": output.clamped, "slowed": output.slowed}
        if trip is not None:
            self._journal.write("trip", code=trip.code, sentence=trip.sentence)
            self._tell("tripped", code=trip.code, sentence=trip.sentence)
        landing = descend(self._source, self._limits, 0.0 if output is None else output.voltage_V, self._journal)
        status = _status(trip, landing)
        if landing.confirmed:
            with contextlib.suppress(SupplyError):
                self._source.release()
        self._source.close()
        alarm = "" if landing.confirmed else f"{UNKNOWN} ({landing.sentence})"
        end = {
            "status": int(status),
            "confirmed": landing.confirmed,
            "off_s": landing.off_s,
            "harmless_s": landing.harmless_s,
            "code": trip.code if trip else None,
            "sentence": trip.sentence if trip else None,
            "alarm": alarm,
            **counts,
        }
        self._journal.write("end", **end)
        self._journal.sync()
        was_told = self._tell("end", **end)
        if alarm and not was_told:
            sys.stderr.write(f"\n{alarm}\n")
        return status

    def _refuse(self, status: Status, sentence: str) -> Status:
        self._journal.write("refused", sentence=sentence)
        self._tell("refused", status=int(status), sentence=sentence)
        self._source.close()
        return status

    def _tell(self, what: str, **facts: Any) -> bool:
        """Whether it was sent: a controller that has gone is no reason to do anything else."""
        try:
            self._channel.send({"say": what, **facts})
        except (ClosedError, ValueError):
            return False
        return True


def _is_finite(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and math.isfinite(value)


def _status(trip: Trip | None, landing: Landing) -> Status:
    if not landing.confirmed:
        return Status.UNCONFIRMED
    if trip is None:
        return Status.DONE
    return Status.REFUSED if trip.code == "limits" else Status.TRIPPED
