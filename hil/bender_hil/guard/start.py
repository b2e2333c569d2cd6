"""The controller's side of the guard: start it, command it, wait for its end."""

import contextlib
import math
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from bender_hil.guard.guard import Status
from bender_hil.guard.settings import GuardOrders
from bender_hil.messages import Channel, ClosedError, Listener, Message
from bender_hil.process_group import own_group
from bender_hil.sources.kinds import address_of
from bender_hil.supply.parse import Identity
from bender_loop.errors import InputError, RunError
from bender_loop.shell.last_word import UNKNOWN, Output

_START_S, _ARM_S = 20.0, 20.0
_SILENCE_S = 1.0
"""A guard says something five times a second, whatever it waits for; one that is silent for longer hangs."""
_OPEN_SILENCE_S = 3.0
"""The same while it opens the instrument, which may take a look at the network."""
_ANSWER_S = 0.05
_GRACE_S = 0.3
"""Beyond its own deadline, for a guard to say that it has kept it."""
_SPARES = 3
_CALL_S = 4.0
"""So many spare guards are started, one after the other, and each has so long to switch off and call."""


class OutputUnknownError(RunError):
    """The run has failed and the output could not be confirmed off; the message is the alarm."""


class Ended(NamedTuple):
    """How a guarded run ended.

    Attributes:
        status: of the guard.
        code, sentence: why it tripped, None where it did not.
        alarm: loud words where the output could not be confirmed off, else empty.
        facts: everything that the guard said.
    """

    status: Status
    code: str | None
    sentence: str | None
    alarm: str
    facts: Message


class GuardProcess:
    """A guard in a process of its own.

    Args:
        orders: port and password are filled in here.

    Attributes:
        ready: what the guard said about the instrument.
        alarmed_s: `time.perf_counter` when an alarm was raised before the end, None where none was.

    Raises:
        InputError: another instrument is at the address, or it cannot do what the limits ask for.
        RunError: no instrument answers, or the guard does not start.
        OutputUnknownError: it could not be armed, and not be confirmed off either.
    """

    def __init__(self, orders: GuardOrders) -> None:
        # the run may leave its directory, and a directory its place
        self._orders = orders = replace(orders, journal=str(Path(orders.journal).absolute()))
        self._end: Message | None = None
        self._ended: Ended | None = None
        self._identity: Identity | None = None
        # from here on the last word of this process is that of the guard
        self._output = Output()
        self._is_off = self._is_silent = False
        self.alarmed_s: float | None = None
        self._off_due_s = math.inf
        self._heard_s = time.perf_counter()
        listener = Listener()
        with contextlib.closing(listener):
            try:
                self.process = start_process(replace(orders, port=listener.port, password=listener.password))
            except Exception:
                # a guard without its orders opens nothing
                self._output.confirm_off()
                raise
            self._channel = self._accept(listener)
        self.ready = self._wait_ready()

    def command(self, sequence: int, voltage_V: float, frame_s: float, tip_um: float | None) -> None:
        """Command a voltage that rests on the frame grabbed at `frame_s`; None for a tip that was not found.

        Raises:
            ClosedError: the guard has gone.
        """
        self._channel.send(
            {"do": "command", "sequence": sequence, "voltage_V": voltage_V, "frame_s": frame_s, "tip_um": tip_um}
        )

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
            self._heard_s = time.perf_counter()
            if message.get("say") == "end":
                self._end = message
            if message.get("say") != "alive":
                return True
        silence_s = time.perf_counter() - self._heard_s
        if silence_s > _SILENCE_S:
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
            # one that hangs has been lost since its last word
            silent_since_s = self._heard_s if self._is_silent else time.perf_counter()
            self._off_due_s = silent_since_s + self._orders.limits.shutdown_limit_s
            message = self._end or self._follow(self._channel)
            if message is not None:
                self._acknowledge(self._channel)
                self._finish(self.process)
                self._ended = _ended(message)
            else:
                self.process.kill()
                self._finish(self.process)
                self._ended = self._make_safe()
            self._output.alarm = self._ended.alarm
            self._channel.close()
            if self._ended.alarm and self.alarmed_s is None:
                # whoever asked may have files to write and processes to end before it says so
                self.alarmed_s = time.perf_counter()
                _shout(self._ended.alarm)
        return self._ended

    def close(self) -> None:
        """For a run that was torn apart: the output comes down, and the alarm is raised where it does not."""
        if self._ended is None:
            self.trip("controller_failed", "the run was torn apart")
            self.wait()

    def _follow(self, channel: Channel) -> Message | None:
        """Listen to a guard on its way down; returns its last word, None when it is lost."""
        limits = self._orders.limits
        last_s = math.inf
        self._heard_s = time.perf_counter()
        while True:
            try:
                message = channel.receive(_ANSWER_S)
            except ClosedError:
                return None
            now_s = time.perf_counter()
            if message is not None:
                self._heard_s = now_s
                match message.get("say"):
                    case "end":
                        return message
                    case "off":
                        self._is_off, last_s = True, now_s + limits.discharge_limit_s + _GRACE_S
                    case "overdue":
                        self.alarmed_s = now_s
                        _shout(f"{message.get('sentence')}: do not touch it")
            if now_s - self._heard_s > _SILENCE_S or now_s > last_s:
                return None
            self._raise_alarm_when_due(now_s)

    def _raise_alarm_when_due(self, now_s: float) -> None:
        if not self._is_off and self.alarmed_s is None and now_s > self._off_due_s + _GRACE_S:
            self.alarmed_s = now_s
            _shout(f"{UNKNOWN}; it is still being tried to switch it off")

    def _finish(self, process: "subprocess.Popen[str]") -> None:
        try:
            process.wait(timeout=_SILENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _acknowledge(self, channel: Channel) -> None:
        with contextlib.suppress(ClosedError):
            channel.send({"do": "heard"})

    def _make_safe(self) -> Ended:
        """Start spare guards until one has said how the way down ended."""
        journal = str(Path(self._orders.journal).with_name("rescue.jsonl"))
        message = None
        for _ in range(_SPARES):
            self._is_off = False
            message = self._spare(replace(self._orders, make_safe=True, journal=journal, identity=self._identity))
            if message is not None:
                break
        sentence = "the guard has gone; another one made safe"
        if message is not None and message.get("confirmed") is True:
            return Ended(Status.TRIPPED, "guard_gone", sentence, "", message)
        alarm = UNKNOWN if message is None else str(message.get("alarm") or UNKNOWN)
        return Ended(Status.UNCONFIRMED, "guard_gone", "the guard has gone, and no other one could confirm", alarm, {})

    def _spare(self, orders: GuardOrders) -> Message | None:
        """What a spare guard says at its end; None when it was lost too."""
        listener = Listener()
        process = None
        try:
            process = start_process(replace(orders, port=listener.port, password=listener.password))
            channel = self._spare_channel(listener, process)
            if channel is None:
                return None
            with channel:
                message = self._follow(channel)
                if message is not None:
                    self._acknowledge(channel)
                return message
        except Exception:
            # no process can be started, for want of memory as well, or it has gone before it had its orders
            return None
        finally:
            listener.close()
            if process is not None:
                self._finish(process)

    def _spare_channel(self, listener: Listener, process: "subprocess.Popen[str]") -> Channel | None:
        """The channel to a spare guard, which switches off before it calls; None when it does not call."""
        end_s = time.perf_counter() + _CALL_S
        while process.poll() is None and time.perf_counter() < end_s:
            with contextlib.suppress(ClosedError):
                return listener.accept(_ANSWER_S)
            self._raise_alarm_when_due(time.perf_counter())
        process.kill()
        return None

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
        self._output.confirm_off()
        raise RunError("the guard did not start; see its message above")

    def _wait_ready(self) -> Message:
        end_s = time.perf_counter() + _ARM_S
        self._heard_s = time.perf_counter()
        with contextlib.suppress(ClosedError):
            while time.perf_counter() < min(end_s, self._heard_s + _OPEN_SILENCE_S):
                message = self._channel.receive(_ANSWER_S)
                if message is None:
                    continue
                self._heard_s = time.perf_counter()
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
        ended = self.wait()
        if ended.status is Status.UNCONFIRMED:
            raise OutputUnknownError(f"the supply could not be armed: {ended.sentence}; {ended.alarm}")
        kind = InputError if ended.status is Status.REFUSED else RunError
        raise kind(f"the supply could not be armed: {ended.sentence}")

    def _refused(self, message: Message) -> InputError | RunError:
        self._output.confirm_off()
        self._finish(self.process)
        self._channel.close()
        kind = InputError if message["status"] == Status.REFUSED else RunError
        resource, sentence = address_of(self._orders.source), message["sentence"]
        return kind(sentence if sentence.startswith(resource) else f"{resource}: {sentence}")


def start_process(orders: GuardOrders) -> subprocess.Popen[str]:
    """Start a guard with its orders, out of reach of what is typed at this terminal."""
    words = [sys.executable, "-P", "-m", "bender_hil.guard"]
    # its complaints may stand on the standard error; the standard output is not its own, and not to be kept open
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, **own_group())
    if process.stdin is not None:
        with process.stdin as stdin:
            stdin.write(orders.to_json() + "\n")
    return process


def _ended(message: Message) -> Ended:
    """How a guard says that it ended; without its word for it, nothing is confirmed."""
    status, alarm = Status(message["status"]), str(message["alarm"])
    if message.get("confirmed") is not True:
        status, alarm = Status.UNCONFIRMED, alarm or UNKNOWN
    return Ended(status, message["code"], message["sentence"], alarm, message)


def _shout(sentence: str) -> None:
    with contextlib.suppress(OSError):
        sys.stderr.write(f"\nbender: {sentence}\n")
        sys.stderr.flush()
