"""The tip board: where the emulated physics says where the tip is, for whoever draws it.

A small memory-mapped file, so that it works between processes that were started by any means on any platform. The
writer is the physics, some thousand times a second; readers look whenever they expose a frame. Nobody waits for
anybody: the writer fills the next of many lines and then counts on, and a reader takes the line that was counted last.
So a writer that is stopped in the middle of a line leaves the line before it. A reader that was itself stopped for so
long that its line was written anew looks again.

Times are those of `time.perf_counter`, which is one clock for all processes of a machine (monotonic clock on Linux,
performance counter on Windows).

    writer = TipWriter(path)                      # in the physics; makes the file
    writer.publish(time_s, tip_um, velocity_um_per_s)

    reader = TipReader(path)                      # in the microscope
    time_s, tip_um, velocity_um_per_s = reader.at()
"""

import math
import mmap
import struct
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bender_loop.shell.closed_at_exit import ClosedAtExit

_COUNTER = struct.Struct("<q")
_VALUES = struct.Struct("<3d")
_CLOCK = struct.Struct("<2d")
_LINES = 2048
_CLOCK_PLACE = _COUNTER.size + _LINES * _VALUES.size
_SIZE = _CLOCK_PLACE + _CLOCK.size


class TipOnBoard(NamedTuple):
    """What stands on the board.

    Attributes:
        time_s: `time.perf_counter` for which it holds.
        tip_um: where the tip is.
        velocity_um_per_s: how fast it moves.
    """

    time_s: float
    tip_um: float
    velocity_um_per_s: float


def _place(count: int) -> int:
    return _COUNTER.size + count % _LINES * _VALUES.size


class _Board(ClosedAtExit):
    def __init__(self, path: Path | str, access: str) -> None:
        with Path(path).open(access) as file:
            mode = mmap.ACCESS_READ if access == "rb" else mmap.ACCESS_WRITE
            self._memory = mmap.mmap(file.fileno(), _SIZE, access=mode)

    def close(self) -> None:
        """Let go of the file; it stays for the others."""
        self._memory.close()


class TipWriter(_Board):
    """The only writer; makes the file with the tip at rest.

    Args:
        path: of the board; whoever starts the processes chooses it and removes it afterwards.

    Raises:
        OSError: the file cannot be made.
    """

    def __init__(self, path: Path | str) -> None:
        lines = _VALUES.pack(-math.inf, 0.0, 0.0) * (_LINES - 1)
        first = _VALUES.pack(time.perf_counter(), 0.0, 0.0)
        Path(path).write_bytes(_COUNTER.pack(0) + first + lines + _CLOCK.pack(0.0, 0.0))
        super().__init__(path, "r+b")
        self._count = 0

    def publish(self, time_s: float, tip_um: float, velocity_um_per_s: float) -> None:
        """Replace what stands on the board."""
        _VALUES.pack_into(self._memory, _place(self._count + 1), time_s, tip_um, velocity_um_per_s)
        self._count += 1
        # a slice is copied as a whole; `pack_into` may clear its place first, and 0 is a count as well
        self._memory[: _COUNTER.size] = _COUNTER.pack(self._count)

    def start_clock(self, start_s: float, rate_Hz: float) -> None:
        """Say when the sample clock of the source has begun, for inputs that sample by it."""
        self._memory[_CLOCK_PLACE:_SIZE] = _CLOCK.pack(start_s, rate_Hz)


class TipReader(_Board):
    """A reader of a board that exists.

    Raises:
        OSError: there is no such file.
    """

    def __init__(self, path: Path | str) -> None:
        super().__init__(path, "rb")

    def at(self) -> TipOnBoard:
        """What stands on the board now."""
        while True:
            before = self._counted()
            values = _VALUES.unpack_from(self._memory, _place(before))
            if self._counted() - before < _LINES - 1:
                return TipOnBoard(*values)

    def clock(self) -> tuple[float, float]:
        """Return when the sample clock of the source has begun, and its rate; a rate of 0 where it never has."""
        start_s, rate_Hz = _CLOCK.unpack_from(self._memory, _CLOCK_PLACE)
        return start_s, rate_Hz

    def past_um(self, times_s: np.ndarray) -> np.ndarray:
        """Return where the tip was at each of these times: what stood on the board then, up to two seconds ago."""
        newest = self._counted()
        lines = np.frombuffer(self._memory[_COUNTER.size : _CLOCK_PLACE], dtype=float).reshape(_LINES, 3)
        # from the oldest line that is whole on: the one after the newest may be written right now
        order = np.arange(newest + 2, newest + _LINES + 1) % _LINES
        at_s, tip_um = lines[order, 0], lines[order, 1]
        return tip_um[np.maximum(np.searchsorted(at_s, times_s, side="right") - 1, 0)]

    def _counted(self) -> int:
        return _COUNTER.unpack(self._memory[: _COUNTER.size])[0]
