"""The tip board: where the emulated physics says where the tip is, for whoever draws it.

A small memory-mapped file, so that it works between processes that were started by any means on any platform. The
writer is the physics, some thousand times a second; readers look whenever they expose a frame. Nobody waits for
anybody: the writer fills the next of a few lines and then counts on, and a reader takes the line that was counted last.
So a writer that is stopped in the middle of a line leaves the line before it. A reader that was itself stopped for so
long that its line was written anew looks again.

Times are those of `time.perf_counter`, which is one clock for all processes of a machine (monotonic clock on Linux,
performance counter on Windows).

    writer = TipWriter(path)                      # in the physics; makes the file
    writer.publish(time_s, tip_um, velocity_um_per_s)

    reader = TipReader(path)                      # in the microscope
    time_s, tip_um, velocity_um_per_s = reader.at()
"""

import mmap
import struct
import time
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

_COUNTER = struct.Struct("<q")
_VALUES = struct.Struct("<3d")
_LINES = 16
_SIZE = _COUNTER.size + _LINES * _VALUES.size


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


class _Board:
    def __init__(self, path: Path | str, access: str) -> None:
        with Path(path).open(access) as file:
            mode = mmap.ACCESS_READ if access == "rb" else mmap.ACCESS_WRITE
            self._memory = mmap.mmap(file.fileno(), _SIZE, access=mode)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

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
        Path(path).write_bytes(_COUNTER.pack(0) + _VALUES.pack(time.perf_counter(), 0.0, 0.0) * _LINES)
        super().__init__(path, "r+b")
        self._count = 0

    def publish(self, time_s: float, tip_um: float, velocity_um_per_s: float) -> None:
        """Replace what stands on the board."""
        _VALUES.pack_into(self._memory, _place(self._count + 1), time_s, tip_um, velocity_um_per_s)
        self._count += 1
        # a slice is copied as a whole; `pack_into` may clear its place first, and 0 is a count as well
        self._memory[: _COUNTER.size] = _COUNTER.pack(self._count)


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

    def _counted(self) -> int:
        return _COUNTER.unpack(self._memory[: _COUNTER.size])[0]
