"""The guard's course: open, arm, watch, come down. It ends in one way only."""

import contextlib
import math
import statistics
import sys
import time
from enum import IntEnum
from os import getpid
from typing import Any, TypeGuard

from bender_hil.guard.descent import Landing, descend
from bender_hil.guard.output import GuardedOutput
from bender_hil.guard.rules import Situation, Trip, judge
from bender_hil.guard.settings import GuardSettings
from bender_hil.guard.stop_ear import StopEar
from bender_hil.log.journal import GuardJournal
from bender_hil.supply.failures import SupplyError, WrongInstrumentError
from bender_hil.supply.source import Source
from bender_loop.errors import InputError
from bender_loop.shell import last_word
from bender_loop.shell.last_word import UNKNOWN
from bender_loop.shell.messages import Channel, ClosedError, Message

FAULT = "guard"
"""Code of a run that an exception in the guard itself has ended."""
_WAIT_S = 0.01
ALIVE_S = 0.2
"""Between two words of a guard, whatever it does."""
_SLOW_S = 0.02
_IDLE_S = 0.05
"""A supply that is given no commands is looked after all the same."""
_MOST_MESSAGES = 1000
"""Taken at a turn: a controller that never pauses does not keep the guard from its own work."""
_HEARD_S = 0.5
"""For the controller to say that it has heard an alarm; after that the guard raises it itself."""
_TRIALS = 3
_UNTIL_FIRST_COMMAND_S = 30.0
"""The heartbeat counts from the first command; until then the output is at 0 V and the rest position is taken."""


class Status(IntEnum):
    """Exit statuses of a guard."""

    DONE = 0
    TRIPPED = 1
    REFUSED = 2
    UNCONFIRMED = last_word.UNCONFIRMED


class Guard:
    """One run's guard.

    Args:
        source: the supply, not open yet.
        limits: what to hold the run to.
        channel: to the controller.
        journal: of the guard.
        ear: that hears STOP; None where nobody may say it.
        watchman: the channel to whoever watches controller and guard; None for nobody.
    """

    def __init__(
        self,
        source: Source,
        limits: GuardSettings,
        channel: Channel,
        journal: GuardJournal,
        ear: StopEar | None = None,
        watchman: Channel | None = None,
    ) -> None:
        self._ear, self._watchman = ear, watchman
        self._source, self._limits, self._channel, self._journal = source, limits, channel, journal
        self._situation = Situation()
        self._output: GuardedOutput | None = None
        self._stopped = self._is_coming_down = self._is_playing = False
        self._said_s = 0.0
        self._command_due: tuple[float, int] | None = None
        source.patience.waiting = self._say_alive
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
            trip = Trip(FAULT, f"a fault in the guard itself: {type(error).__name__}: {error}")
        return self._come_down(trip)

    def _open(self) -> Status | None:
        """Nothing is switched before the right instrument has answered, and fast enough."""
        try:
            identity = self._source.open()
            turn_s = self._turn_s()
        except (InputError, WrongInstrumentError) as error:
            return self._refuse(Status.REFUSED, str(error))
        except SupplyError as error:
            return self._refuse(Status.TRIPPED, f"{error}; is it switched on, and is nothing else connected to it?")
        if turn_s > self._limits.settle_s:
            return self._refuse(
                Status.REFUSED,
                f"its answers are slow: a command and a look at the terminals take {_ms(turn_s)}, and the guard has to "
                f"look once in settle_s = {_ms(self._limits.settle_s)}; use a faster link, or raise guard.settle_s",
            )
        self._journal.write("opened", **identity._asdict(), emulated=identity.is_emulated, turn_s=turn_s, pid=getpid())
        # before anything is switched: whoever comes after a guard that is lost has to know which instrument it was
        self._tell("opened", identity=identity)
        self._identity, self._slow_s = identity, turn_s
        return None

    def _turn_s(self) -> float:
        """How long a command and a look take: twice the median of an answer, of either kind."""
        times_s = []
        for ask in (self._source.voltage_setting_V, self._source.measured_V) * _TRIALS:
            start_s = time.perf_counter()
            ask()
            times_s.append(time.perf_counter() - start_s)
        return statistics.median(times_s[0::2]) + statistics.median(times_s[1::2])

    def _arm(self) -> Trip | None:
        # before anything is switched
        self._tell_watchman(say="arming", identity=self._identity, pid=getpid())
        try:
            remarks = self._source.arm(self._limits.bounds())
        except ValueError as error:
            return Trip("limits", str(error))
        if self._slow_s > _SLOW_S:
            remarks.append(
                f"the supply answers slowly: it carries out at most {1.0 / self._slow_s:.0f} commands per second, "
                "the newest ones"
            )
        self._journal.write("armed", remarks=remarks)
        self._situation.beat_s = time.perf_counter() + _UNTIL_FIRST_COMMAND_S
        self._output = GuardedOutput(self._source, self._limits, self._journal, self._situation)
        told = {} if self._ear is None else {"stop_port": self._ear.port}
        self._tell(
            "ready", identity=self._identity._asdict(), emulated=self._identity.is_emulated, remarks=remarks, **told
        )
        return None

    def _watch(self) -> Trip | None:
        output = self._output
        trip = None
        while output is not None and trip is None and not self._stopped:
            self._say_alive()
            # what waits is heard before the silence is judged: the guard itself may have waited for an answer
            trip = self._hear() or self._look_after_itself()
            self._situation.now_s = time.perf_counter()
            trip = trip or judge(self._limits, self._situation) or self._act(output)
        return trip

    def _hear(self) -> Trip | None:
        """Take every message that waits. Only then is it known how old the newest one is."""
        wait_s = _WAIT_S
        for _ in range(_MOST_MESSAGES):
            message = self._channel.receive(wait_s)
            if message is None:
                return None
            trip = self._take(message)
            if trip is not None or self._stopped:
                return trip
            wait_s = 0.0
        return None

    def _look_after_itself(self) -> Trip | None:
        if self.signal is not None:
            return Trip("signal", f"{self.signal} was sent to the guard")
        if self._ear is not None and self._ear.heard():
            return Trip("stop", "STOP was pressed")
        if self._journal.failure is not None:
            return Trip("journal", f"the guard's journal cannot be written: {self._journal.failure}")
        return None

    def _act(self, output: GuardedOutput) -> Trip | None:
        """Carry out the newest command, or go on with an older one; then look at the output."""
        due, self._command_due = self._command_due, None
        if due is not None:
            output.command(*due)
            return output.patrol(self._channel.has_message)
        output.continue_slew()
        if output.idle_s() > _IDLE_S:
            return output.patrol(self._channel.has_message)
        return None

    def _say_alive(self) -> None:
        if self._is_coming_down and self._ear is not None:
            # whoever says STOP once more is answered, although nothing can come down faster
            self._ear.heard()
        now_s = time.perf_counter()
        if now_s - self._said_s > ALIVE_S:
            self._said_s = now_s
            self._tell("alive")
            if self._is_coming_down:
                self._tell_watchman(say="alive")

    def _take(self, message: Message) -> Trip | None:
        is_command = message.get("do") == "command"
        if is_command or self._situation.frame_s is not None or self._is_playing:
            self._situation.beat_s = time.perf_counter()
        match message.get("do"):
            case "command":
                return self._note(message)
            case "beat":
                return None
            case "play":
                return self._play(message)
            case "trip":
                return Trip(str(message.get("code")), str(message.get("sentence")))
            case "stop":
                self._stopped = True
                return None
            case other:
                return Trip("bad_command", f"the controller sent {other!r}, which is no known order")

    def _play(self, message: Message) -> Trip | None:
        """Let the source play a whole profile; from then on the controller has to show that it is alive."""
        if self._output is None:
            return Trip("bad_command", "the controller wanted to play before the output was armed")
        found = self._output.play(message.get("levels_V"), message.get("rate_Hz"))
        if isinstance(found, Trip):
            return found
        self._is_playing, self._situation.beat_s = True, time.perf_counter()
        self._tell("playing", start_s=found)
        return None

    def _note(self, message: Message) -> Trip | None:
        """Keep a command until nothing newer waits: one that is overtaken is not worth the supply's time."""
        wanted_V, frame_s, tip_um = message.get("voltage_V"), message.get("frame_s"), message.get("tip_um")
        if not (_is_finite(wanted_V) and _is_finite(frame_s) and (tip_um is None or _is_finite(tip_um))):
            return Trip("bad_command", f"the controller commanded {wanted_V!r} V at {tip_um!r} µm, {frame_s!r} s")
        sequence = message.get("sequence", -1)
        if not isinstance(sequence, int):
            return Trip("bad_command", f"the controller gave a command the number {sequence!r}")
        situation = self._situation
        situation.frame_s = frame_s
        situation.lost = situation.lost + 1 if tip_um is None else 0
        situation.tip_um = tip_um
        if self._command_due is not None:
            self._journal.write("superseded", sequence=self._command_due[1], wanted_V=self._command_due[0])
        self._command_due = wanted_V, sequence
        return None

    def _come_down(self, trip: Trip | None) -> Status:
        output = self._output
        self._is_coming_down = True
        self._tell_watchman(say="alive")
        counts = {} if output is None else {"clamped": output.clamped, "slowed": output.slowed}
        if trip is not None:
            self._journal.write("trip", code=trip.code, sentence=trip.sentence)
            self._tell("tripped", code=trip.code, sentence=trip.sentence)
        from_V = 0.0 if output is None else output.voltage_V
        landing = descend(self._source, self._limits, from_V, self._journal, self._tell)
        status = _status(trip, landing)
        if landing.confirmed:
            with contextlib.suppress(Exception):
                self._source.release()
        self._source.close()
        code, sentence = (None, None) if trip is None else trip
        self._tell_watchman(say="end", confirmed=landing.confirmed)
        say_end(self._channel, self._journal, status, landing, code=code, sentence=sentence, **counts)
        return status

    def _refuse(self, status: Status, sentence: str) -> Status:
        self._journal.write("refused", sentence=sentence)
        self._tell("refused", status=int(status), sentence=sentence)
        self._source.close()
        return status

    def _tell(self, what: str, **facts: Any) -> None:
        """Say it to whoever is there: a controller that has gone is no reason to do anything else."""
        with contextlib.suppress(Exception):
            self._channel.send({"say": what, **facts})

    def _tell_watchman(self, **facts: Any) -> None:
        """Tell the watchman; the loss of that one alone changes nothing."""
        if self._watchman is not None:
            with contextlib.suppress(Exception):
                self._watchman.send(facts)


def say_end(channel: Channel | None, journal: GuardJournal, status: Status, landing: Landing, **facts: Any) -> None:
    """Write and tell how the way down ended; an alarm that nobody acknowledges goes to the standard error.

    Args:
        channel: to the controller; None when it cannot be reached.
        journal: of the guard.
        status: of the guard.
        landing: of the way down.
        facts: further ones, for the journal and the controller.
    """
    alarm = "" if landing.confirmed else f"{UNKNOWN} ({landing.sentence})"
    end = {
        "status": int(status),
        "confirmed": landing.confirmed,
        "off_s": landing.off_s,
        "harmless_s": landing.harmless_s,
        **facts,
        "alarm": alarm,
    }
    if channel is not None:
        with contextlib.suppress(Exception):
            channel.send({"say": "end", **end})
    if alarm and not _is_heard(channel):
        with contextlib.suppress(OSError):
            sys.stderr.write(f"\n{alarm}\n")
            sys.stderr.flush()
    journal.write("end", **end)
    journal.sync()


def _is_heard(channel: Channel | None) -> bool:
    """Whether the controller acknowledges the end: one that was stopped takes messages and does nothing with them."""
    end_s = time.perf_counter() + _HEARD_S
    try:
        while channel is not None and time.perf_counter() < end_s:
            message = channel.receive(end_s - time.perf_counter())
            if message is not None and message.get("do") == "heard":
                return True
    except ClosedError:
        pass
    return False


def _ms(time_s: float) -> str:
    return f"{1e3 * time_s:.0f} ms"


def _is_finite(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and math.isfinite(value)


def _status(trip: Trip | None, landing: Landing) -> Status:
    if not landing.confirmed:
        return Status.UNCONFIRMED
    if trip is None:
        return Status.DONE
    return Status.REFUSED if trip.code == "limits" else Status.TRIPPED
