"""The controller's side of the guard: start it, command it, wait for its end."""

import contextlib
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from bender_hil.guard.guard import FAULT, Status
from bender_hil.guard.settings import GuardOrders
from bender_hil.guard.spares import ANSWER_S, SILENCE_S, Ended, WayDown, acknowledge, finish, start_process
from bender_hil.guard.watched import Watchman
from bender_hil.sources.kinds import address_of, where_to_mend
from bender_hil.supply.parse import Identity
from bender_loop.errors import InputError, RunError
from bender_loop.shell.last_word import UNKNOWN, Output
from bender_loop.shell.messages import Channel, ClosedError, Listener, Message

_START_S, _ARM_S = 20.0, 20.0
_PLAY_S = 15.0
"""For a source to take a buffer."""
_SPARE_START_S = 4.0
"""For the watchman to start a guard."""
_OPEN_SILENCE_S = 3.0
"""Longest silence of a guard while it opens the instrument, which may take a look at the network."""


class OutputUnknownError(RunError):
    """The run has failed and the output could not be confirmed off; the message is the alarm."""


class SourceRefusedError(InputError):
    """Another source answers, or it cannot do what the limits ask for; nothing is switched on."""


class SourceFailedError(RunError):
    """The source does not answer, or could not be armed; its output is off."""


class GuardFaultError(RunError):
    """The source could not be armed because of a fault in the program; its output is off.

    Args:
        sentence: what happened.
        advice: what to do about it.
    """

    def __init__(self, sentence: str, advice: str) -> None:
        super().__init__(f"{sentence}; {advice}")
        self.sentence, self.advice = sentence, advice


class GuardProcess:
    """A guard in a process of its own.

    Args:
        orders: port and password are filled in here.

    Attributes:
        ready: what the guard said about the instrument.

    Raises:
        SourceRefusedError: another instrument is at the address, or it cannot do what the limits ask for.
        SourceFailedError: no instrument answers, or it could not be armed.
        RunError: the guard does not start.
        GuardFaultError: the program failed, and not the instrument.
        OutputUnknownError: it could not be armed, and not be confirmed off either.
    """

    def __init__(self, orders: GuardOrders) -> None:
        # the run may leave its directory, and a directory its place
        orders = replace(orders, journal=str(Path(orders.journal).absolute()))
        self._end: Message | None = None
        self._ended: Ended | None = None
        self._identity: Identity | None = None
        self._is_silent = False
        self._watchman = Watchman(orders)
        watch = {"watch_port": self._watchman.port, "watch_password": self._watchman.password}
        self._orders = orders = replace(orders, **watch)
        self._way = WayDown(orders, start_process)
        listener = Listener()
        # from here on the last word of this process is that of the guard
        self._output = Output()
        with contextlib.closing(listener):
            try:
                self.process = start_process(replace(orders, port=listener.port, password=listener.password))
            except Exception:
                # a guard without its orders opens nothing
                self._close_unopened()
                raise
            self._channel = self._accept(listener)
        self.ready = self._wait_ready()

    @property
    def alarmed_s(self) -> float | None:
        """`time.perf_counter` when an alarm was raised before the end, None where none was."""
        return self._way.alarmed_s

    def command(self, sequence: int, voltage_V: float, frame_s: float, tip_um: float | None) -> None:
        """Command a voltage that rests on the frame grabbed at `frame_s`; None for a tip that was not found.

        Raises:
            ClosedError: the guard has gone.
        """
        self._channel.send(
            {"do": "command", "sequence": sequence, "voltage_V": voltage_V, "frame_s": frame_s, "tip_um": tip_um}
        )

    def play(self, levels_V: Sequence[float], rate_Hz: float) -> float | None:
        """Let the source play levels from its own buffer; returns when the first began, None where the run has ended.

        Raises:
            ClosedError: the guard has gone.
        """
        self._channel.send({"do": "play", "levels_V": list(levels_V), "rate_Hz": rate_Hz})
        end_s = time.perf_counter() + _PLAY_S
        while time.perf_counter() < end_s:
            message = self._channel.receive(ANSWER_S)
            if message is not None:
                self._way.heard_s = time.perf_counter()
            if message is None or message.get("say") == "alive":
                continue
            if message.get("say") == "playing":
                return float(message["start_s"])
            if message.get("say") == "end":
                self._end = message
            return None
        return None

    def beat(self) -> None:
        """Say that the controller is alive; ClosedError when the guard has gone."""
        self._channel.send({"do": "beat"})

    def trip(self, code: str, sentence: str) -> None:
        """End the run for a reason that the controller has found."""
        with contextlib.suppress(ClosedError):
            self._channel.send({"do": "trip", "code": code, "sentence": sentence})

    def stop(self) -> None:
        """End the run because it is done."""
        with contextlib.suppress(ClosedError):
            self._channel.send({"do": "stop"})

    def has_tripped(self) -> bool:
        """Whether the guard has ended the run by itself; asks without waiting.

        Raises:
            ClosedError: the guard has gone, or hangs: it says something many times a second, whatever it does.
        """
        while (message := self._channel.receive(0.0)) is not None:
            self._way.heard_s = time.perf_counter()
            if message.get("say") == "end":
                self._end = message
            if message.get("say") != "alive":
                return True
        silence_s = time.perf_counter() - self._way.heard_s
        if silence_s > SILENCE_S:
            self._is_silent = True
            self.process.kill()
            raise ClosedError(f"the guard was silent for {silence_s:.1f} s")
        return False

    def wait(self) -> Ended:
        """Until the output is off, or the alarm is raised; a second call returns the same.

        The way down has one deadline, `shutdown_limit_s` from here, or from the last word of a guard that hangs. A
        guard that goes silent on it, whatever the reason, is killed and replaced by a spare one that makes safe. What
        is not confirmed by then is said at once on the standard error, while the attempts go on. Only a guard's own
        word is a confirmation, never the way a process ended.
        """
        if self._ended is None:
            # one that is known to hang has been lost since its last word
            since_s = self._way.heard_s if self._is_silent else time.perf_counter()
            self._way.due_s = since_s + self._orders.limits.shutdown_limit_s
            message = self._end or self._way.follow(self._channel)
            if message is not None:
                acknowledge(self._channel)
                finish(self.process)
                self._ended = _ended(message)
            else:
                self.process.kill()
                finish(self.process)
                self._ended = self._way.make_safe(replace(self._orders, identity=self._identity))
            self._output.alarm = self._ended.alarm
            self._channel.close()
            if self._ended.alarm and self._way.alarmed_s is None:
                # whoever asked may have files to write and processes to end before it says so
                self._way.shout(self._ended.alarm)
            self._leave_watchman()
        return self._ended

    def close(self) -> None:
        """For a run that was torn apart: the output comes down, and the alarm is raised where it does not."""
        if self._ended is None:
            self.trip("controller_failed", "the run was torn apart")
            self.wait()

    def _accept(self, listener: Listener) -> Channel:
        end_s = time.perf_counter() + _START_S
        while time.perf_counter() < end_s:
            with contextlib.suppress(ClosedError):
                return listener.accept(0.5)
            if self.process.poll() is not None:
                break
        self.process.kill()
        self.process.wait()
        # a guard opens nothing before it has called
        self._close_unopened()
        raise RunError("the guard did not start; see its message above")

    def _wait_ready(self) -> Message:
        end_s = time.perf_counter() + _ARM_S
        self._way.heard_s = time.perf_counter()
        with contextlib.suppress(ClosedError):
            while time.perf_counter() < min(end_s, self._way.heard_s + _OPEN_SILENCE_S):
                message = self._channel.receive(ANSWER_S)
                if message is None:
                    continue
                self._way.heard_s = time.perf_counter()
                match message.get("say"):
                    case "opened":
                        self._identity = Identity(*message["identity"])
                    case "ready":
                        return message
                    case "refused":
                        raise self._refused(message)
                    case "end":
                        self._end = message
                        break
        if self._end is None:
            # it is silent or gone, perhaps in the middle of arming
            self.process.kill()
            self.process.wait()
            if not self._has_opened():
                self._close_unopened()
                self._channel.close()
                raise RunError(
                    f"the guard ended or said nothing for {_OPEN_SILENCE_S:g} s before it opened the source; nothing "
                    "was switched on. Close what keeps this machine busy, and try again"
                )
        raise self._unarmed(self.wait())

    def _unarmed(self, ended: Ended) -> InputError | RunError:
        """What to raise for a source that could not be armed."""
        sentence = f"the source could not be armed: {ended.sentence}"
        if ended.status is Status.UNCONFIRMED:
            return OutputUnknownError(f"{sentence}; {ended.alarm}")
        if ended.code == FAULT:
            return GuardFaultError(sentence, where_to_mend(self._orders.source))
        kind = SourceRefusedError if ended.status is Status.REFUSED else SourceFailedError
        return kind(sentence)

    def _has_opened(self) -> bool:
        """Whether a guard that has ended had said who answers, which it does before it switches anything."""
        with contextlib.suppress(ClosedError):
            while self._identity is None and (message := self._channel.receive(0.0)) is not None:
                if message.get("say") == "opened":
                    self._identity = Identity(*message["identity"])
        return self._identity is not None

    def _leave_watchman(self) -> None:
        limits = self._orders.limits
        if self._way.is_lost:
            # this process may have no descriptors or no memory left; that one has, and its alarm is said again here
            self._watchman.hand_over(_SPARE_START_S + limits.shutdown_limit_s + limits.discharge_limit_s)
        else:
            self._watchman.dismiss()

    def _close_unopened(self) -> None:
        self._output.confirm_off()
        self._watchman.dismiss()

    def _refused(self, message: Message) -> InputError | RunError:
        self._close_unopened()
        finish(self.process)
        self._channel.close()
        kind = SourceRefusedError if message["status"] == Status.REFUSED else SourceFailedError
        resource, sentence = address_of(self._orders.source), message["sentence"]
        return kind(sentence if sentence.startswith(resource) else f"{resource}: {sentence}")


def _ended(message: Message) -> Ended:
    """How a guard says that it ended; without its word for it, nothing is confirmed."""
    status, alarm = Status(message["status"]), str(message["alarm"])
    if message.get("confirmed") is not True:
        status, alarm = Status.UNCONFIRMED, alarm or UNKNOWN
    return Ended(status, message["code"], message["sentence"], alarm, message)
