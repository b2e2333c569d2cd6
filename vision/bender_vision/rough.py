"""Finding the wire: what is dark against its surroundings, its contour, and the one that enters where the wire does."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_loop.shell.opencv import import_cv2
from bender_vision.darkness import darkness, wire_mask
from bender_vision.lines import Line, middle_of, robust_line
from bender_vision.settings import TrackerSettings
from bender_vision.tip import TipLostError

_REDUCED_WIDTH_PX = 5.0
_SHORTEST_WIDTHS = 5.0
_MOST_CONTOURS = 2500
_STEEPEST = 0.6
_THINNEST_WIDTHS = 0.6


@dataclass(frozen=True, slots=True)
class RoughWire:
    """The wire to a pixel or two.

    Attributes:
        line: along its last part, in pixels of the picture.
        end_x: where it ends.
        entry_y: where it enters.
    """

    line: Line
    end_x: float
    entry_y: float


def find_wire(image: NDArray[np.uint8], width_px: float, settings: TrackerSettings) -> RoughWire:
    """Find the one wire that enters from the left.

    Args:
        image: (height, width), the wire darker than its surroundings.
        width_px: of the wire that is expected.
        settings: what is believed.

    Raises:
        TipLostError: there is no picture, no wire, or more than one.
    """
    cv2 = import_cv2()
    factor = max(1, round(width_px / _REDUCED_WIDTH_PX))
    height, width = image.shape
    small = cv2.resize(image, (width // factor, height // factor), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (3, 3), 0)
    mask = wire_mask(darkness(small, width_px / factor), settings)
    contour = _entering_contour(cv2, mask, width_px / factor)
    return _measured(contour, width_px / factor, settings, factor)


def _entering_contour(cv2: Any, mask: NDArray[np.uint8], width: float) -> NDArray[np.int32]:
    """The contour, (n, 2), of the only long thing that touches the left border."""
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if len(contours) > _MOST_CONTOURS:
        raise TipLostError("the picture is noise")
    shortest = _SHORTEST_WIDTHS * width
    long = [found for found in contours if len(found) > 2.0 * shortest]
    boxes = [cv2.boundingRect(found) for found in long]
    entering = [
        found
        for found, box in zip(long, boxes, strict=True)
        if box[0] <= 1 and box[2] >= shortest and _thickness(cv2, found) >= _THINNEST_WIDTHS * width
    ]
    if not entering:
        raise TipLostError("no wire enters")
    if len(entering) > 1:
        raise TipLostError(f"{len(entering)} wires enter")
    return entering[0][:, 0, :]


def _thickness(cv2: Any, contour: NDArray[np.int32]) -> float:
    """Mean thickness of something long; hairs are thinner than the wire."""
    # the contour runs through the outermost pixels' middles
    return 2.0 * cv2.contourArea(contour) / len(contour) + 1.0


def _measured(contour: NDArray[np.int32], width: float, settings: TrackerSettings, factor: int) -> RoughWire:
    """The middle line of the contour's last part; `width` is in the reduced picture's pixels."""
    x, y = contour[:, 0], contour[:, 1]
    upper = np.full(int(x.max()) + 1, np.iinfo(np.int32).max)
    lower = np.full(len(upper), -1)
    np.minimum.at(upper, x, y)
    np.maximum.at(lower, x, y)
    thick = lower - upper + 1
    usual = middle_of(thick)
    if not 0.4 * width <= usual <= 3.0 * width:
        raise TipLostError("what enters is not as thick as the wire")
    # a hair that hangs on the end is thinner than the wire
    end = int(np.flatnonzero(np.abs(thick - usual) <= 0.4 * usual)[-1])
    start = max(0, int(end - settings.fit_widths * width))
    column = np.arange(start, end + 1)
    good = np.abs(thick[column] - usual) <= max(1.0, 0.2 * usual)
    if np.count_nonzero(good) < 0.4 * len(column):
        raise TipLostError("what enters is no straight wire")
    middle = 0.5 * (upper[column] + lower[column])[good].astype(np.float64)
    # pixel numbers count middles, so reduced pixel i covers i * factor ... i * factor + factor - 1
    shift = 0.5 * (factor - 1)
    line = robust_line(column[good].astype(np.float64) * factor + shift, middle * factor + shift, 0.5 * factor)
    if abs(line.slope) > _STEEPEST:
        raise TipLostError("what enters is too steep for the wire")
    entry = 0.5 * (upper[int(x.min())] + lower[int(x.min())])
    return RoughWire(line, (end + 0.5) * factor + shift, entry * factor + shift)
