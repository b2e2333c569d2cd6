"""The controller's side of the guard: start it, command it, wait for its end."""

import contextlib
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from bender_hil.guard.guard import UNKNOWN, Status
from bender_hil.guard.settings import GuardOrders
from bender_hil.wire import Channel, ClosedError, Listener, Message
from bender_loop.errors import InputError, RunError

_START_S, _ARM_S = 20.0, 20.0
_GUARD_SILENCE_S = 1.0
"""Beside the time that the supply may take for an answer: longer than that, the guard itself hangs."""


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

    Raises:
        InputError: another instrument is at the address, or it cannot do what the limits ask for.
        RunError: no instrument answers, or the guard does not start.
        OutputUnknownError: it could not be armed, and not be confirmed off either.
    """

    def __init__(self, orders: GuardOrders) -> None:
        self._orders = orders
        self._end: Message | None = None
        self._heard_s = time.perf_counter()
        listener = Listener()
        self.process = start_process(replace(orders, port=listener.port, password=listener.password))
        try:
            self._channel = self._accept(listener)
        finally:
            listener.close()
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
        if silence_s > _GUARD_SILENCE_S + 2.0 * self._orders.supply.timeout_s:
            self.process.kill()
            raise ClosedError(f"the guard was silent for {silence_s:.1f} s")
        return False

    def wait(self) -> Ended:
        """Until the guard has ended; a guard that was lost is replaced by one that makes safe."""
        limits = self._orders.limits
        end_s = time.perf_counter() + limits.shutdown_limit_s + limits.discharge_limit_s + 5.0
        with contextlib.suppress(ClosedError):
            while self._end is None and time.perf_counter() < end_s:
                message = self._channel.receive(0.5)
                if message is not None and message.get("say") == "end":
                    self._end = message
        self._finish()
        return _ended(self._end) if self._end is not None else self._make_safe()

    def close(self) -> None:
        """For a run that was torn apart: a guard that is still there is left alone and comes down, which is awaited."""
        if self.process.poll() is None:
            self._channel.close()
            limits = self._orders.limits
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(timeout=limits.shutdown_limit_s + limits.discharge_limit_s + 5.0)

    def _finish(self) -> None:
        self._channel.close()
        try:
            self.process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def _make_safe(self) -> Ended:
        journal = Path(self._orders.journal)
        spare = start_process(replace(self._orders, port=None, journal=str(journal.with_name("rescue.jsonl"))))
        status = Status.UNCONFIRMED
        limits = self._orders.limits
        try:
            code = spare.wait(timeout=limits.shutdown_limit_s + limits.discharge_limit_s + 10.0)
            status = Status.TRIPPED if code == Status.TRIPPED else Status.UNCONFIRMED
        except subprocess.TimeoutExpired:
            spare.kill()
            spare.wait()
        alarm = "" if status is Status.TRIPPED else UNKNOWN
        return Ended(status, "guard_gone", "the guard has gone; another one made safe", alarm, {})

    def _accept(self, listener: Listener) -> Channel:
        end_s = time.perf_counter() + _START_S
        while time.perf_counter() < end_s:
            with contextlib.suppress(ClosedError):
                return listener.accept(0.5)
            if self.process.poll() is not None:
                break
        self.process.kill()
        self.process.wait()
        raise RunError("the guard did not start; its complaint stands above")

    def _wait_ready(self) -> Message:
        with contextlib.suppress(ClosedError):
            message = self._channel.receive(_ARM_S)
            if message is not None and message.get("say") == "ready":
                self._heard_s = time.perf_counter()
                return message
            if message is not None and message.get("say") == "refused":
                self._finish()
                kind = InputError if message["status"] == Status.REFUSED else RunError
                resource, sentence = self._orders.supply.resource, message["sentence"]
                raise kind(sentence if sentence.startswith(resource) else f"{resource}: {sentence}")
        ended = self.wait()
        if ended.status is Status.UNCONFIRMED:
            raise OutputUnknownError(f"the supply could not be armed: {ended.sentence}; {ended.alarm}")
        kind = InputError if ended.status is Status.REFUSED else RunError
        raise kind(f"the supply could not be armed: {ended.sentence}")


def start_process(orders: GuardOrders) -> subprocess.Popen[str]:
    """Start a guard with its orders."""
    process = subprocess.Popen([sys.executable, "-m", "bender_hil.guard"], stdin=subprocess.PIPE, text=True)
    if process.stdin is not None:
        with process.stdin as stdin:
            stdin.write(orders.to_json() + "\n")
    return process


def _ended(message: Message) -> Ended:
    return Ended(Status(message["status"]), message["code"], message["sentence"], message["alarm"], message)
