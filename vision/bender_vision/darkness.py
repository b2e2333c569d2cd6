"""What is dark against its surroundings, however uneven the light."""

import numpy as np
from numpy.typing import NDArray

from bender_loop.shell.opencv import import_cv2
from bender_vision.lines import middle_of
from bender_vision.settings import TrackerSettings
from bender_vision.tip import TipLostError

_ENTRY_PART = 0.12
_BLACK_LEVELS, _WHITE_LEVELS = 8.0, 253.0
# The wire is this wide where what is behind it is worked out.
_COARSE_WIDTH_PX = 1.25
_RIM = 5


def darkness(image: NDArray[np.uint8], width_px: float) -> NDArray[np.uint8]:
    """How much darker than what is behind it every pixel is, 255 for black.

    What is behind comes from a closing wider than the wire, which removes whatever is dark and thin.

    Args:
        image: (height, width).
        width_px: of the wire.

    Raises:
        TipLostError: the picture is black or white.
    """
    cv2 = import_cv2()
    factor = max(1, round(width_px / _COARSE_WIDTH_PX))
    size = (max(8, image.shape[1] // factor), max(8, image.shape[0] // factor))
    coarse = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    level = float(coarse.mean())
    if level < _BLACK_LEVELS:
        raise TipLostError("the picture is black")
    if level > _WHITE_LEVELS:
        raise TipLostError("the picture is white")
    # without a rim of its own the closing takes a dark corner for something that lies on the light
    rimmed = cv2.copyMakeBorder(coarse, _RIM, _RIM, _RIM, _RIM, cv2.BORDER_REPLICATE)
    closed = cv2.morphologyEx(rimmed, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5)))
    behind = cv2.blur(closed, (3, 3))[_RIM:-_RIM, _RIM:-_RIM]
    behind = cv2.resize(behind, (image.shape[1], image.shape[0]), interpolation=cv2.INTER_LINEAR)
    return cv2.divide(cv2.subtract(behind, image), cv2.max(behind, 1), scale=255.0)


def wire_mask(dark: NDArray[np.uint8], settings: TrackerSettings) -> NDArray[np.uint8]:
    """What is at least half as dark as what lies at the left border, where the wire enters; 1 or 0.

    Raises:
        TipLostError: nothing there is dark enough for a wire.
    """
    entry = dark[:, : max(4, round(_ENTRY_PART * dark.shape[1]))]
    depth = middle_of(entry.max(axis=0))
    if depth < 255.0 * settings.least_contrast:
        raise TipLostError("no wire enters")
    return (dark > 0.5 * depth).view(np.uint8)
