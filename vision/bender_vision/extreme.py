"""The paper's way to the tip: grey picture, Gaussian filter, contour, and of the largest contour the farthest point.

It moves in whole pixels, sits on a corner of the wire, and is believed whenever there is a contour; it stays for
comparison. Uneven light is taken out first and the threshold lies halfway to the wire's darkness, without which it
finds the dark corners of most pictures.
"""

import numpy as np
from numpy.typing import NDArray

from bender_loop.shell.opencv import import_cv2
from bender_vision.darkness import darkness, wire_mask
from bender_vision.settings import TrackerSettings


def extreme_point(image: NDArray[np.uint8], width_px: float, settings: TrackerSettings) -> tuple[float, float]:
    """Column and row of the point of the largest dark contour that lies farthest from the left border.

    Raises:
        TipLostError: the picture is black or white, or nothing dark lies at the left border.
    """
    cv2 = import_cv2()
    smooth = cv2.GaussianBlur(image, (5, 5), 0)
    mask = wire_mask(darkness(smooth, width_px), settings)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    points = max(contours, key=cv2.contourArea)[:, 0, :]
    x, y = points[int(points[:, 0].argmax())]
    return float(x), float(y)
