"""Stands in for the controller of a run and does something wrong in it (a program).

It ends as every command does: with what the guard has said as its last line, and the status that goes with it.
"""

import contextlib
import os
import sys
import time
from collections.abc import Callable

from bender_hil.guard.settings import GuardOrders
from bender_hil.guard.start import GuardProcess
from bender_hil.log.ending import Conduct, EndOfRun, last_line
from bender_loop.shell.last_word import status_at_last
from bender_loop.shell.messages import ClosedError

LEVEL_V, TICK_S = 30.0, 0.02
_STEP_V = 3.0
_LONGEST_S = 30.0


def main() -> int:
    """Drive one run; the first word is what to do wrong, the second the guard's orders. Returns the exit status."""
    how, orders = sys.argv[1], GuardOrders.from_json(sys.argv[2])
    guard = GuardProcess(orders)
    with contextlib.closing(guard):
        with contextlib.suppress(ClosedError):
            _drive(guard, how)
        ended = guard.wait()
    sys.stdout.write(f"{last_line(Conduct((), ()), EndOfRun(ended.code, ended.sentence, ended.alarm, None))}\n")
    return int(ended.status)


def _drive(guard: GuardProcess, how: str) -> None:
    start_s = time.perf_counter()
    for tick in range(round(LEVEL_V / _STEP_V) + 6):
        if guard.has_tripped():
            return
        level_V = min(LEVEL_V, _STEP_V * tick)
        guard.command(tick, level_V, time.perf_counter(), 0.4 * level_V)
        time.sleep(max(0.0, start_s + (tick + 1) * TICK_S - time.perf_counter()))
    _misbehave(guard, how)
    while not guard.has_tripped():
        time.sleep(TICK_S)


def _misbehave(guard: GuardProcess, how: str) -> None:
    """What a controller may do wrong, by the name of the state."""
    if how in _LINES:
        guard._channel._stream.sendall(_LINES[how])
    elif how in _DEEDS:
        _DEEDS[how](guard)
    else:
        raise ValueError(f"found {how!r}, expected one of {', '.join([*_LINES, *_DEEDS])}")


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
    "exits": lambda _: sys.exit(1),
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


if __name__ == "__main__":
    # as every command ends: the last word is that of the outputs
    told = 1
    try:
        told = main()
    except SystemExit as leaving:
        told = int(leaving.code or 0)
    except Exception as error:
        sys.stderr.write(f"bender: {error}\n")
    sys.stdout.flush()
    os._exit(status_at_last(told))
