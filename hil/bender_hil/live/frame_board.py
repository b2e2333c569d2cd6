"""The newest frame, for whoever shows it: a memory-mapped file with one writer, who never waits.

A counter is odd while the writer is at work; a reader that meets an odd or a changed counter looks again, or lets the
frame go: the next one is near.
"""

import mmap
import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_HEAD = struct.Struct("<qqqqdddd")
_LARGEST_BYTES = 1 << 24
_TRIALS = 20

Image = NDArray[np.uint8]


class ShownFrame(NamedTuple):
    """A frame on the board.

    Attributes:
        number: of the frame, 0 before the first.
        grabbed_s: `time.perf_counter` when it was grabbed.
        tip_um: where the tip is, NaN where it was not found.
        tip_px: column and row of the tip in it, NaN where it was not found.
        image: (height, width).
    """

    number: int
    grabbed_s: float
    tip_um: float
    tip_px: tuple[float, float]
    image: Image


class FrameWriter:
    """The writer; makes the file when the first frame comes.

    Args:
        path: of the board.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._memory: mmap.mmap | None = None
        self._count = 0

    def publish(
        self, number: int, grabbed_s: float, tip_um: float | None, tip_px: tuple[float, float] | None, image: Image
    ) -> None:
        """Replace the frame on the board; one that is larger than the first of them is left out."""
        if image.ndim != 2 or image.nbytes > _LARGEST_BYTES:
            return
        if self._memory is None:
            self._path.write_bytes(bytes(_HEAD.size + image.nbytes))
            with self._path.open("r+b") as file:
                self._memory = mmap.mmap(file.fileno(), _HEAD.size + image.nbytes)
        if len(self._memory) < _HEAD.size + image.nbytes:
            return
        height, width = image.shape
        nan = float("nan")
        x, y = (nan, nan) if tip_px is None else tip_px
        values = (height, width, number, grabbed_s, nan if tip_um is None else tip_um, x, y)
        _HEAD.pack_into(self._memory, 0, self._count + 1, *values)
        self._memory[_HEAD.size : _HEAD.size + image.nbytes] = np.ascontiguousarray(image).tobytes()
        self._count += 2
        struct.pack_into("<q", self._memory, 0, self._count)

    def close(self) -> None:
        """Let go of the file."""
        if self._memory is not None:
            self._memory.close()
            self._memory = None


def frame_number(path: Path) -> int:
    """Return the number of the frame on a board, -1 where there is none."""
    try:
        with path.open("rb", buffering=0) as file:
            head = file.read(_HEAD.size)
    except OSError:
        return -1
    return -1 if len(head) < _HEAD.size or not _HEAD.unpack(head)[0] else int(_HEAD.unpack(head)[3])


def read_frame(path: Path) -> ShownFrame | None:
    """Return the frame on a board; None where there is none yet, or the writer was stopped in the middle of one."""
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as memory:
            for _ in range(_TRIALS):
                count, height, width, number, grabbed_s, tip_um, x, y = _HEAD.unpack_from(memory, 0)
                if count % 2 or count == 0 or _HEAD.size + height * width > len(memory):
                    continue
                image = np.frombuffer(memory[_HEAD.size : _HEAD.size + height * width], np.uint8)
                if struct.unpack_from("<q", memory, 0)[0] == count:
                    return ShownFrame(number, grabbed_s, tip_um, (x, y), image.reshape(height, width))
    except (OSError, ValueError):
        return None
    return None
