"""`python -m bender_hil.guard.watchman`: a third process that does nothing but wait for controller and guard.

The controller holds its standard input, every guard a connection. When the last of them has gone and no guard has said
that the output is off, as after an out-of-memory killer that takes both, it starts a guard that makes safe; so it does
when a controller that can start none any more lets go of it. Where that cannot be confirmed, it raises the alarm. A
guard without a controller that falls silent is ended. The watchman loads next to nothing and runs in a session of its
own, so that what ends the others seldom ends it.

It reads the guard's orders as one line, answers with its port and password, and ends at the line "done".
"""

import contextlib
import json
import os
import signal
import sys
import threading
import time
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any

from bender_loop.shell.messages import Channel, ClosedError, Listener

_IGNORED = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGBREAK", "SIGTSTP", "SIGTTIN", "SIGTTOU", "SIGPIPE")
_ACCEPT_S = 3600.0
_SILENCE_S = 1.0
"""A guard on its way down says something five times a second; one that is silent for longer hangs."""
Event = tuple[str, Any]


@dataclass(slots=True)
class Known:
    """What the watchman knows of the run.

    Attributes:
        guards: connections to guards that live.
        has_controller: whether the controller lives.
        may_be_on: a guard has begun to arm, and none has said since that the output is off.
        identity: what the instrument said of itself.
        pid: of the guard that has armed.
        gone_s: `time.perf_counter` when the controller had gone.
    """

    guards: int = 0
    has_controller: bool = True
    may_be_on: bool = False
    identity: list[str] | None = None
    pid: int | None = None
    gone_s: float = 0.0

    def take(self, kind: str, what: Any) -> None:
        """Take an event: somebody has come or gone, or a guard has said something."""
        match kind:
            case "came":
                self.guards += 1
            case "went":
                self.guards -= 1
            case "controller_gone":
                self.has_controller, self.gone_s = False, time.perf_counter()
            case "said" if what.get("say") == "arming":
                self.may_be_on, self.identity, self.pid = True, what.get("identity"), what.get("pid")
            case "said" if what.get("say") == "end":
                self.may_be_on = self.may_be_on and what.get("confirmed") is not True

    @property
    def is_alone(self) -> bool:
        """Whether controller and guards have all gone."""
        return not self.has_controller and self.guards <= 0


def main() -> int:
    """Watch one run; returns 0, or 3 where an output could not be confirmed off."""
    for name in _IGNORED:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    orders = sys.stdin.readline()
    listener = Listener()
    events: SimpleQueue[Event] = SimpleQueue()
    for work in (_hear_controller, _hear_guards):
        threading.Thread(target=work, args=(events, listener), daemon=True).start()
    sys.stdout.write(json.dumps({"port": listener.port, "password": listener.password}) + "\n")
    sys.stdout.flush()
    known = Known()
    while not known.is_alone:
        try:
            kind, what = events.get(timeout=None if known.has_controller else _SILENCE_S)
        except Empty:
            if not known.may_be_on:
                continue
            _end(known.pid)
            break
        if kind == "done":
            return 0
        known.take(kind, what)
    return _make_safe(orders, known) if known.may_be_on else 0


def _end(pid: int | None) -> None:
    with contextlib.suppress(OSError):
        if pid is not None:
            os.kill(pid, getattr(signal, "SIGKILL", signal.SIGTERM))


def _hear_controller(events: "SimpleQueue[Event]", _: Listener) -> None:
    for line in sys.stdin:
        if line.strip() == "done":
            events.put(("done", None))
    events.put(("controller_gone", None))


def _hear_guards(events: "SimpleQueue[Event]", listener: Listener) -> None:
    while True:
        with contextlib.suppress(ClosedError):
            channel = listener.accept(_ACCEPT_S)
            events.put(("came", None))
            threading.Thread(target=_hear_guard, args=(events, channel), daemon=True).start()


def _hear_guard(events: "SimpleQueue[Event]", channel: Channel) -> None:
    with contextlib.suppress(ClosedError):
        while True:
            message = channel.receive(_ACCEPT_S)
            if message is not None:
                events.put(("said", message))
    events.put(("went", None))


def _make_safe(line: str, known: Known) -> int:
    """Start a guard that makes safe, and say what came of it."""
    from bender_loop.shell.last_word import UNCONFIRMED, UNKNOWN

    try:
        from bender_hil.guard.rescue import make_safe_alone

        alarm = make_safe_alone(line, known.identity, known.gone_s)
    except BaseException:  # whatever it is, somebody has to press the button
        alarm = UNKNOWN
    if alarm:
        _say(f"{alarm}; no guard is left")
        return UNCONFIRMED
    _say("no guard was left; another one made safe, the output is off")
    return 0


def _say(sentence: str) -> None:
    with contextlib.suppress(OSError):
        os.write(2, f"\nbender: {sentence}\n".encode("utf-8", "replace"))


if __name__ == "__main__":
    sys.exit(main())
