"""The eyes: the newest frame of the camera, and where the tip is in it."""

import math
import time
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from bender_hil.camera.reader import Camera
from bender_loop.errors import RunError
from bender_vision.stillness import Stillness
from bender_vision.tracker import Tracker

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
        image: the frame; None for a sensor that is no camera.
        frozen: so many pictures in a row, this one included, show around the wire what the one before them showed.
        tip_px: column and row of the tip in the frame, None where it was not found.
    """

    number: int
    grabbed_s: float
    skipped: int
    tip_um: float | None
    confidence: float
    lost: str | None
    image: Image | None
    frozen: int = 0
    tip_px: tuple[float, float] | None = None


class Eyes(Protocol):
    """What the runner needs of a camera with a tracker behind it."""

    def zero(self, count: int) -> float:
        """Take the rest position from the next `count` frames; returns when the last one was grabbed.

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

    def why_nothing(self) -> str:
        """What may be the matter while nothing comes, as a sentence; empty where nothing is known."""
        ...


class CameraEyes:
    """Camera and tracker.

    Args:
        camera: open.
        tracker: of the wire.
        stillness: tells a frozen picture; None where pictures may repeat.

    Attributes:
        noise_um: standard deviation of the tip at rest, NaN until the rest position has been taken.
    """

    def __init__(self, camera: Camera, tracker: Tracker, stillness: Stillness | None = None) -> None:
        self._camera, self._tracker, self._stillness = camera, tracker, stillness
        self.noise_um = math.nan

    def zero(self, count: int) -> float:
        """Take the rest position from the next `count` frames; a frame that came meanwhile is let go."""
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
                    f"the camera gave {len(images)} frames in {_FIRST_FRAME_S:g} s, expected {count}; "
                    f"{self.why_nothing()}"
                )
        self._tracker.zero(images)
        found = [tip for tip in map(self._tracker.locate, images) if tip.lost is None]
        self.noise_um = float(np.std([tip.displacement_um for tip in found])) if found else 0.0
        if self._stillness is not None:
            self._stillness.learn(images)
            if found and self._stillness.is_dead(found[-1].along_px, found[-1].across_px):
                raise RunError(
                    "rest position: the picture around the wire is the same from frame to frame, without any noise; is "
                    "it live? A source that has no noise needs camera.settings.repeats_count = true"
                )
        # what came meanwhile would be late before the loop begins
        frame = self._camera.newest(0.0)
        return grabbed_s if frame is None else frame.grabbed_s

    def look(self, timeout_s: float) -> Sight | None:
        """The next new frame with its tip."""
        frame = self._camera.newest(timeout_s)
        if frame is None:
            return None
        tip = self._tracker.locate(frame.image)
        tip_um = None if tip.lost is not None else tip.displacement_um
        still = self._stillness
        frozen = 0 if still is None else still.add(frame.image, tip.along_px, tip.across_px)
        return Sight(
            frame.number,
            frame.grabbed_s,
            frame.skipped,
            tip_um,
            tip.confidence,
            tip.lost,
            frame.image,
            frozen,
            None if tip_um is None else self._tracker.in_frame(tip.along_px, tip.across_px),
        )

    def stalled_s(self) -> float:
        """Age of the newest frame."""
        return self._camera.stalled_s()

    def why_nothing(self) -> str:
        """Say what keeps a camera from being read: no connection, or pictures that are sent again."""
        return (
            "is it connected? A picture that is sent again is no new one, unless [camera.settings] says "
            "repeats_count = true."
        )
