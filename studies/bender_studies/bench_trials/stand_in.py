"""Stands in for the controller of a run, up to a state, and stays there (`python -m …bench_trials.stand_in`).

It says on its standard output which state it has reached, and at the end what it believes to have come of the run.
"""

import contextlib
import json
import signal
import sys
import time
from collections.abc import Callable
from typing import Any

from bender_hil.guard.guard import Status
from bender_hil.guard.settings import GuardOrders
from bender_hil.guard.start import GuardProcess, OutputUnknownError
from bender_hil.runner.interrupts import ENDING_SIGNALS
from bender_loop.errors import InputError, RunError
from bender_loop.shell.messages import ClosedError

LEVEL_V, TICK_S = 30.0, 0.02
_STEP_V = 3.0
_LONGEST_S = 30.0


def main() -> int:
    """Drive one run; the first line of the standard input is the state, the second the guard's orders."""
    state, orders = sys.stdin.readline().strip(), GuardOrders.from_json(sys.stdin.readline())
    received: list[str] = []
    for name in ENDING_SIGNALS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda number, _: received.append(signal.Signals(number).name))
    try:
        guard = GuardProcess(orders)
        with contextlib.closing(guard):
            with contextlib.suppress(ClosedError):
                _drive(guard, state, received)
            ended = guard.wait()
    except OutputUnknownError as error:
        _say(outcome="alarm", sentence=str(error))
        return Status.UNCONFIRMED
    except (InputError, RunError) as error:
        _say(outcome="refused", sentence=str(error))
        return 1
    _say(outcome="alarm" if ended.alarm else "off", code=ended.code, sentence=ended.alarm)
    return int(ended.status)


def _drive(guard: GuardProcess, state: str, received: list[str]) -> None:
    start_s = time.perf_counter()
    for tick in range(round(_LONGEST_S / TICK_S)):
        if guard.has_tripped():
            return
        if received:
            guard.trip("interrupted", f"{received[0]} was sent to the controller")
            return
        level_V = 0.0 if state == "armed" else min(LEVEL_V, _STEP_V * tick)
        guard.command(tick, level_V, time.perf_counter(), 0.4 * level_V)
        if state != "opening" and tick == {"armed": 5, "rising": 6}.get(state, round(LEVEL_V / _STEP_V) + 5):
            if state == "descending":
                guard.stop()
            _say(state=state, guard=guard.process.pid)
            if state == "descending":
                return
            if state not in ("armed", "rising", "holding"):
                _misbehave(guard, state)
        time.sleep(max(0.0, start_s + (tick + 1) * TICK_S - time.perf_counter()))


def _misbehave(guard: GuardProcess, how: str) -> None:
    """What a controller may do wrong, by the name of the state."""
    if how in _LINES:
        guard._channel._stream.sendall(_LINES[how])
    elif how in _DEEDS:
        _DEEDS[how](guard)
    else:
        raise ValueError(f"found {how!r}, expected a state or one of {', '.join([*_LINES, *_DEEDS])}")


def _raise(_: GuardProcess) -> None:
    raise ZeroDivisionError("a fault in the controller")


def _flood(guard: GuardProcess) -> None:
    frame_s = time.perf_counter()
    while not guard.has_tripped():
        for sequence in range(100):
            guard.command(sequence, LEVEL_V, frame_s, 1.0)


def _ask_too_much(guard: GuardProcess) -> None:
    for sequence in range(50):
        guard.command(sequence, 1e9, time.perf_counter(), 1.0)
        time.sleep(TICK_S)
    guard.stop()


def _rest_on_an_old_frame(guard: GuardProcess) -> None:
    frame_s = time.perf_counter()
    while not guard.has_tripped():
        guard.command(0, LEVEL_V, frame_s, 1.0)
        time.sleep(TICK_S)


_LINES = {
    "commands nan": b'{"do": "command", "sequence": 0, "voltage_V": NaN, "frame_s": 0, "tip_um": 0}\n',
    "commands 1e999 V": b'{"do": "command", "sequence": 0, "voltage_V": 1e999, "frame_s": 0, "tip_um": 0}\n',
    "commands a word": b'{"do": "command", "sequence": 0, "voltage_V": "30", "frame_s": 0, "tip_um": 0}\n',
    "gives an unknown order": b'{"do": "dance"}\n',
    "sends nonsense": b"\x00\xffnonsense\n",
}
_DEEDS: dict[str, Callable[[GuardProcess], object]] = {
    "exits": lambda _: sys.exit(0),
    "raises": _raise,
    "hangs": lambda _: time.sleep(_LONGEST_S),
    "closes the channel": lambda guard: guard._channel.close(),
    "stops in the middle of a line": lambda guard: (
        guard._channel._stream.sendall(b'{"do": "command"'),
        time.sleep(_LONGEST_S),
    ),
    "floods the guard": _flood,
    "commands 1e9 V": _ask_too_much,
    "rests on an old frame": _rest_on_an_old_frame,
}
MISBEHAVIOUR = (*_LINES, *_DEEDS)


def _say(**facts: Any) -> None:
    with contextlib.suppress(OSError):
        sys.stdout.write(json.dumps(facts) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
