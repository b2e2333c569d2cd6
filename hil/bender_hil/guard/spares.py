"""What comes after a guard that is lost: listening to the way down, spare guards, and the alarm when it is due.

Only a guard's own word is a confirmation, never the way a process ended.
"""

import contextlib
import math
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from bender_hil.guard.guard import Status
from bender_hil.guard.settings import GuardOrders
from bender_loop.shell.last_word import UNKNOWN
from bender_loop.shell.messages import Channel, ClosedError, Listener, Message
from bender_loop.shell.process_group import own_group

SILENCE_S = 1.0
"""A guard says something five times a second, whatever it waits for; one that is silent for longer hangs."""
ANSWER_S = 0.05
_GRACE_S = 0.3
"""Beyond its own deadline, for a guard to say that it has kept it."""
_CALLS_S = (4.0, 4.0, 30.0)
"""So many spare guards are started, one after the other, and each has so long to switch off and call.

The last one is given up late: on a machine that is too busy for the others, giving up early would leave the output on.
"""

StartGuard = Callable[[GuardOrders], "subprocess.Popen[str]"]


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


class WayDown:
    """The way down of one run as it is seen from outside the guard.

    Args:
        orders: of the run; with the identity of its instrument where that is known.
        start: starts a guard.

    Attributes:
        alarmed_s: `time.perf_counter` when an alarm was raised before the end, None where none was.
        heard_s: when a guard last said something.
        due_s: when the output has to be off.
        is_lost: no guard is left, and none could be started that would have said how it stands.
    """

    def __init__(self, orders: GuardOrders, start: StartGuard) -> None:
        self._orders, self._start = orders, start
        self._is_off = self.is_lost = False
        self.alarmed_s: float | None = None
        self.heard_s = time.perf_counter()
        self.due_s = math.inf

    def follow(self, channel: Channel) -> Message | None:
        """Listen to a guard on its way down; returns its last word, None when it is lost.

        One that is silent has been lost since its last word, which may be older than the way down.
        """
        limits = self._orders.limits
        last_s = math.inf
        while True:
            try:
                message = channel.receive(ANSWER_S)
            except ClosedError:
                return None
            now_s = time.perf_counter()
            if message is not None:
                self.heard_s = now_s
                match message.get("say"):
                    case "end":
                        return message
                    case "off":
                        self._is_off, last_s = True, now_s + limits.discharge_limit_s + _GRACE_S
                    case "overdue":
                        self.shout(f"{message.get('sentence')}: do not touch it")
            if now_s - self.heard_s > SILENCE_S:
                self.due_s = min(self.due_s, self.heard_s + limits.shutdown_limit_s)
                return None
            if now_s > last_s:
                return None
            self._raise_alarm_when_due(now_s)

    def make_safe(self, orders: GuardOrders) -> Ended:
        """Start spare guards until one has said how the way down ended.

        Args:
            orders: of the run, with what is known of its instrument by now.
        """
        journal = str(Path(orders.journal).with_name("rescue.jsonl"))
        message = None
        for call_s in _CALLS_S:
            self._is_off = False
            message = self._spare(replace(orders, make_safe=True, journal=journal), call_s)
            if message is not None:
                break
        self.is_lost = message is None
        sentence = "the guard has gone; another one made safe"
        if message is not None and message.get("confirmed") is True:
            return Ended(Status.TRIPPED, "guard_gone", sentence, "", message)
        alarm = UNKNOWN if message is None else str(message.get("alarm") or UNKNOWN)
        return Ended(Status.UNCONFIRMED, "guard_gone", "the guard has gone, and no other one could confirm", alarm, {})

    def shout(self, sentence: str) -> None:
        """Raise an alarm on the standard error."""
        self.alarmed_s = time.perf_counter()
        with contextlib.suppress(OSError):
            sys.stderr.write(f"\nbender: {sentence}\n")
            sys.stderr.flush()

    def _raise_alarm_when_due(self, now_s: float) -> None:
        if not self._is_off and self.alarmed_s is None and now_s > self.due_s + _GRACE_S:
            self.shout(f"{UNKNOWN}; it is still being tried to switch it off")

    def _spare(self, orders: GuardOrders, call_s: float) -> Message | None:
        """What a spare guard says at its end; None when it was lost too, or has not called in time."""
        process = listener = None
        try:
            listener = Listener()
            process = self._start(replace(orders, port=listener.port, password=listener.password))
            channel = self._spare_channel(listener, process, call_s)
            if channel is None:
                return None
            with channel:
                self.heard_s = time.perf_counter()
                message = self.follow(channel)
                if message is not None:
                    acknowledge(channel)
                return message
        except Exception:
            # no process can be started, for want of memory as well, or it has gone before it had its orders
            return None
        finally:
            if listener is not None:
                listener.close()
            if process is not None:
                finish(process)

    def _spare_channel(self, listener: Listener, process: "subprocess.Popen[str]", call_s: float) -> Channel | None:
        """The channel to a spare guard, which switches off before it calls; None when it does not call."""
        end_s = time.perf_counter() + call_s
        while process.poll() is None and time.perf_counter() < end_s:
            with contextlib.suppress(ClosedError):
                return listener.accept(ANSWER_S)
            self._raise_alarm_when_due(time.perf_counter())
        process.kill()
        return None


def start_process(orders: GuardOrders) -> "subprocess.Popen[str]":
    """Start a guard with its orders, out of reach of what is typed at this terminal."""
    words = [sys.executable, "-P", "-m", "bender_hil.guard"]
    # its complaints may stand on the standard error; the standard output is not its own, and not to be kept open
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, **own_group())
    if process.stdin is not None:
        with process.stdin as stdin:
            stdin.write(orders.to_json() + "\n")
    return process


def acknowledge(channel: Channel) -> None:
    """Tell a guard that its last word was heard."""
    with contextlib.suppress(ClosedError):
        channel.send({"do": "heard"})


def finish(process: "subprocess.Popen[str]") -> None:
    """Wait for a guard that has said its last word, and kill one that does not end."""
    try:
        process.wait(timeout=SILENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
