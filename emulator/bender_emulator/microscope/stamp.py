"""A patch of black and white cells in the corner of a frame: its number, when it was taken, where the tip was.

It measures the way from light to command, and errors against the truth, from outside; nothing of the bench reads it
to do its work.
"""

import binascii
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_FIELDS = struct.Struct("<IQi")
_CHECK = struct.Struct("<H")
_CELL_PX = 4
_ROWS = 8
_COLUMNS = _FIELDS.size + _CHECK.size
_BLACK, _WHITE = 16, 235
HEIGHT_PX, WIDTH_PX = _ROWS * _CELL_PX, _COLUMNS * _CELL_PX


@dataclass(frozen=True, slots=True)
class Stamp:
    """What is written into a frame.

    Attributes:
        number: of the frame, from the server's start.
        taken_ns: `time.perf_counter_ns` in the middle of the exposure.
        tip_nm: where the tip was, nm.
    """

    number: int
    taken_ns: int
    tip_nm: int


def write_stamp(image: NDArray[np.uint8], stamp: Stamp) -> None:
    """Draw the stamp into the lower right corner, in place.

    Raises:
        ValueError: the picture is smaller than the stamp, or a value does not fit.
    """
    if image.shape[0] < HEIGHT_PX or image.shape[1] < WIDTH_PX:
        raise ValueError(f"image: found {image.shape}, expected at least {HEIGHT_PX} x {WIDTH_PX}")
    try:
        payload = _FIELDS.pack(stamp.number, stamp.taken_ns, stamp.tip_nm)
    except struct.error as error:
        raise ValueError(f"stamp: {stamp} does not fit ({error})") from None
    data = payload + _CHECK.pack(binascii.crc_hqx(payload, 0xFFFF))
    bits = np.unpackbits(np.frombuffer(data, np.uint8)).reshape(_COLUMNS, _ROWS).T
    cells = np.where(bits, np.uint8(_WHITE), np.uint8(_BLACK))
    image[-HEIGHT_PX:, -WIDTH_PX:] = cells.repeat(_CELL_PX, axis=0).repeat(_CELL_PX, axis=1)


def read_stamp(image: NDArray[np.uint8]) -> Stamp | None:
    """The stamp of a frame, or None where there is none or it is damaged."""
    if image.shape[0] < HEIGHT_PX or image.shape[1] < WIDTH_PX:
        return None
    patch = image[-HEIGHT_PX:, -WIDTH_PX:].reshape(_ROWS, _CELL_PX, _COLUMNS, _CELL_PX)
    bits = patch[:, 1:-1, :, 1:-1].mean(axis=(1, 3)) > 0.5 * (_BLACK + _WHITE)
    data = np.packbits(bits.T).tobytes()
    payload = data[: _FIELDS.size]
    if _CHECK.unpack(data[_FIELDS.size :])[0] != binascii.crc_hqx(payload, 0xFFFF):
        return None
    return Stamp(*_FIELDS.unpack(payload))
