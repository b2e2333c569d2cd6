"""The eyes: the newest frame of the camera, and where the tip is in it."""

import time
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from bender_hil.camera.reader import Camera
from bender_hil.vision.tracker import Tracker
from bender_loop.errors import RunError

_FIRST_FRAME_S = 10.0

Image = NDArray[np.uint8]


class Sight(NamedTuple):
    """What was seen.

    Attributes:
        number: of the frame.
        grabbed_s: `time.perf_counter` when it was grabbed.
        skipped: frames since the one before that nobody saw.
        tip_um: where the tip is, None where it was not found.
        confidence: 0 ... 1.
        lost: why it was not found.
        image: the frame.
    """

    number: int
    grabbed_s: float
    skipped: int
    tip_um: float | None
    confidence: float
    lost: str | None
    image: Image


class Eyes(Protocol):
    """What the runner needs of a camera with a tracker behind it."""

    def zero(self, count: int) -> float:
        """Take the rest position from the next `count` frames; returns when the last was grabbed.

        Raises:
            RunError: there are no frames, or no tip in them.
        """
        ...

    def look(self, timeout_s: float) -> Sight | None:
        """The next new frame, None when there was none within `timeout_s`."""
        ...

    def stalled_s(self) -> float:
        """Age of the newest frame."""
        ...


class CameraEyes:
    """Camera and tracker.

    Args:
        camera: open.
        tracker: of the wire.
    """

    def __init__(self, camera: Camera, tracker: Tracker) -> None:
        self._camera, self._tracker = camera, tracker

    def zero(self, count: int) -> float:
        """Take the rest position from the next `count` frames."""
        images: list[Image] = []
        end_s = time.perf_counter() + _FIRST_FRAME_S
        grabbed_s = 0.0
        while len(images) < count:
            frame = self._camera.newest(0.1)
            if frame is not None:
                images.append(frame.image)
                grabbed_s = frame.grabbed_s
            elif time.perf_counter() > end_s:
                raise RunError(
                    f"the camera gave {len(images)} frames in {_FIRST_FRAME_S:g} s, expected {count}; is it connected?"
                )
        self._tracker.zero(images)
        return grabbed_s

    def look(self, timeout_s: float) -> Sight | None:
        """The next new frame with its tip."""
        frame = self._camera.newest(timeout_s)
        if frame is None:
            return None
        tip = self._tracker.locate(frame.image)
        tip_um = None if tip.lost is not None else tip.displacement_um
        return Sight(frame.number, frame.grabbed_s, frame.skipped, tip_um, tip.confidence, tip.lost, frame.image)

    def stalled_s(self) -> float:
        """Age of the newest frame."""
        return self._camera.stalled_s()
