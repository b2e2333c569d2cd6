"""The wire's surroundings, unrolled: one column of pixels across the wire for every pixel along the picture."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_loop.shell.opencv import import_cv2
from bender_vision.lines import Line
from bender_vision.tip import TipLostError

Values = NDArray[np.float64]

_HALF_HEIGHT_WIDTHS = 2.2
_SIDE_WIDTHS = 1.35
_SMOOTHING_PX = 1.0


@dataclass(frozen=True, slots=True)
class Strip:
    """Darkness along a line.

    Attributes:
        x: pixel columns, (n,).
        y: pixel row of the strip's middle in each, (n,), whole numbers.
        darkness: as a fraction of what is behind, (2 * half + 1, n); the row `half` is the middle.
        light: level of what is behind, the brighter side, (n,).
        imbalance: difference of what is behind above and below the wire, as a fraction, (n,).
        half: rows on either side.
    """

    x: Values
    y: Values
    darkness: Values
    light: Values
    imbalance: Values
    half: int

    def core(self, half_rows: float) -> Values:
        """Mean darkness near the middle of each column."""
        rows = max(0, int(half_rows))
        return self.darkness[self.half - rows : self.half + rows + 1].mean(axis=0)

    def within(self, half_rows: float) -> Values:
        """Darkness on so many rows either side of the middle, (m, n)."""
        rows = min(self.half, math.ceil(half_rows))
        return self.darkness[self.half - rows : self.half + rows + 1]


def unroll(image: NDArray[np.uint8], line: Line, first_x: float, last_x: float, width_px: float) -> Strip:
    """Cut the strip out along `line`, without resampling: columns are shifted by whole pixels only.

    Raises:
        TipLostError: the strip leaves the picture.
    """
    cv2 = import_cv2()
    height, width = image.shape
    half = math.ceil(_HALF_HEIGHT_WIDTHS * width_px) + 2
    x = np.arange(max(0, math.floor(first_x)), min(width - 1, math.ceil(last_x)) + 1)
    if len(x) < 3:
        raise TipLostError("the tip is out of view")
    y = np.rint(line.at(x)).astype(np.intp)
    low, high = int(y.min()) - half - 3, int(y.max()) + half + 4
    row, right = max(low, 0), min(int(x[-1]) + 4, width)
    left = max(int(x[0]) - 3, 0)
    part = image[row : min(high, height), left:right]
    if part.shape[0] < 2 * half:
        raise TipLostError("the tip is out of view")
    smooth = cv2.GaussianBlur(part, (5, 5), _SMOOTHING_PX) if part.size else part
    offsets = np.arange(-half, half + 1)[:, None]
    rows = np.clip(y[None, :] + offsets - row, 0, part.shape[0] - 1)
    levels = smooth[rows, (x - left)[None, :]].astype(np.float64)
    side = max(2, half - math.ceil(_SIDE_WIDTHS * width_px))
    above, below = (np.sort(part, axis=0)[side // 2] for part in (levels[:side], levels[-side:]))
    light = np.maximum(above, below)
    imbalance = np.abs(above - below) / np.maximum(light, 1.0)
    darkness = 1.0 - levels / np.maximum(_behind(above, below, half, side), 1.0)
    return Strip(x.astype(np.float64), y.astype(np.float64), darkness, light, imbalance, half)


def _behind(above: Values, below: Values, half: int, side: int) -> Values:
    """What is behind the wire: a straight run between both sides."""
    share = np.linspace(0.0, 1.0, 2 * half + 1)[:, None]
    # the medians stand in the middle of their sides
    inner = (share * 2 * half - 0.5 * (side - 1)) / (2 * half - side + 1)
    return above + (below - above) * inner


def edge_darkness(image: NDArray[np.uint8], column: int, y: float, width_px: float) -> float:
    """How much darker one column of the picture is at `y`, over half a wire's width, than beside it; 0 if nothing."""

    def mean(first: float, last: float) -> float:
        rows = image[max(0, round(first)) : max(0, round(last) + 1), column]
        return float(rows.mean()) if rows.size else math.nan

    inner = mean(y - 0.25 * width_px, y + 0.25 * width_px)
    beside = [
        mean(y - 2.5 * width_px, y - 1.5 * width_px),
        mean(y + 1.5 * width_px, y + 2.5 * width_px),
    ]
    behind = max((level for level in beside if level == level), default=0.0)
    return 1.0 - inner / behind if behind > 0.0 and inner == inner else 0.0
