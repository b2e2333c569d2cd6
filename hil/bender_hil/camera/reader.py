"""The newest frame of a source: a thread that only reads, and a clock that is read where the frame arrives.

OpenCV's own time of a frame is nominal for streams and of the driver's clock for devices, so the time of a frame is
the machine's clock right after the frame was grabbed; both are kept. A reader that falls behind would work on frames
that waited in buffers: here frames that nobody fetched are replaced by the next one, and counted.
"""

import threading
import time
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bender_hil.camera.settings import CameraSettings
from bender_hil.camera.source import FILE, Opened, kind_of, open_source
from bender_loop.errors import InputError
from bender_loop.shell.opencv import import_cv2

# A read that blocks far longer than any timeout that was set will not come back: its thread is given up.
_GIVEN_UP_S = 5.0
_CLOSING_S = 3.0


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture.

    Attributes:
        image: uint8, (height, width), grey.
        number: counts all frames that were grabbed, over reopenings too; it starts at 1.
        grabbed_s: `time.perf_counter` right after the frame was grabbed.
        position_ms: what OpenCV says of the frame's time; nominal for streams.
        skipped: frames that were grabbed since the last one fetched and that nobody saw.
    """

    image: NDArray[np.uint8]
    number: int
    grabbed_s: float
    position_ms: float
    skipped: int


@dataclass(frozen=True, slots=True)
class CameraCounts:
    """What happened since the camera was opened.

    Attributes:
        grabbed: frames that arrived and are new.
        skipped: of these, replaced before anybody fetched them.
        missed: frames that by the rate asked for should have arrived in gaps between two others.
        repeated: pictures equal to the one before in every pixel, not counted as frames.
        reopened: how often the source was opened anew.
    """

    grabbed: int = 0
    skipped: int = 0
    missed: int = 0
    repeated: int = 0
    reopened: int = 0


class Camera:
    """A source of frames that always gives its newest one.

    Use it as a context manager. The source is opened on entering; afterwards a thread reads it, opens it anew when
    it fails or falls silent, and never gives up before the end of the context.

    Args:
        source: device number, file, or address of a stream.
        frames_per_s: asked of a device, pace of a file, and what gaps are held against; None: as it comes.
        settings: how to open it and what to lock.
    """

    def __init__(
        self, source: str | int, *, frames_per_s: float | None = None, settings: CameraSettings | None = None
    ) -> None:
        if frames_per_s is not None and not 0.0 < frames_per_s < 1e5:
            raise ValueError(f"frames_per_s: found {frames_per_s}, expected more than 0")
        self._source, self._frames_per_s = source, frames_per_s
        self._settings = CameraSettings() if settings is None else settings
        self._news = threading.Condition()
        self._closing = threading.Event()
        self._newest: Frame | None = None
        self._fetched = 0
        self._grabbed = self._skipped = self._missed = self._repeated = self._reopened = 0
        self._generation = 0
        self._thread: threading.Thread | None = None
        self._reading_since_s = self._fresh_s = time.perf_counter()
        self.opened: Opened | None = None
        self.ended = False

    def __enter__(self) -> Self:
        """Open the source.

        Raises:
            InputError: it cannot be opened, or OpenCV is missing.
        """
        self.opened = open_source(self._source, self._settings, self._frames_per_s)
        self._reading_since_s = self._fresh_s = time.perf_counter()
        self._start(self.opened)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.set()
        with self._news:
            self._news.notify_all()
        if self._thread is not None:
            self._thread.join(_CLOSING_S)

    @property
    def counts(self) -> CameraCounts:
        """What happened since the camera was opened."""
        with self._news:
            return CameraCounts(self._grabbed, self._skipped, self._missed, self._repeated, self._reopened)

    def newest(self, timeout_s: float) -> Frame | None:
        """Wait for a frame newer than the last one that was fetched; None when none came within `timeout_s`."""
        self._replace_a_stuck_reader()
        with self._news:
            self._news.wait_for(lambda: self._has_news() or self._closing.is_set() or self.ended, timeout_s)
            if not self._has_news() or self._newest is None:
                return None
            self._fetched = self._newest.number
            return self._newest

    def stalled_s(self) -> float:
        """Seconds since the last new frame was grabbed, or since opening; needs nothing of the reading thread."""
        return time.perf_counter() - self._fresh_s

    def _has_news(self) -> bool:
        return self._newest is not None and self._newest.number > self._fetched

    def _start(self, opened: Opened | None) -> None:
        self._generation += 1
        self._thread = threading.Thread(
            target=self._read_for_ever, args=(opened, self._generation), name="camera reader", daemon=True
        )
        self._thread.start()

    def _replace_a_stuck_reader(self) -> None:
        if self._thread is None or self._closing.is_set() or self.ended:
            return
        if time.perf_counter() - self._reading_since_s > _GIVEN_UP_S:
            self._reading_since_s = time.perf_counter()
            self._start(None)

    def _is_current(self, generation: int) -> bool:
        return generation == self._generation and not self._closing.is_set()

    def _read_for_ever(self, opened: Opened | None, generation: int) -> None:
        while self._is_current(generation):
            if opened is None:
                opened = self._try_to_open(generation)
                continue
            self._read_until_it_fails(opened, generation)
            opened.capture.release()
            opened = None
            if kind_of(self._source) == FILE:
                with self._news:
                    self.ended = True
                    self._news.notify_all()
                return
        if opened is not None:
            opened.capture.release()

    def _try_to_open(self, generation: int) -> Opened | None:
        self._reading_since_s = time.perf_counter()
        if self._closing.wait(self._settings.reopen_pause_s):
            return None
        try:
            opened = open_source(self._source, self._settings, self._frames_per_s)
        except InputError:
            return None
        if not self._is_current(generation):
            opened.capture.release()
            return None
        with self._news:
            self._reopened += 1
            self.opened = opened
        return opened

    def _read_until_it_fails(self, opened: Opened, generation: int) -> None:
        cv2 = import_cv2()
        capture = opened.capture
        before: NDArray[np.uint8] | None = None
        pace_s = self._pace_s(cv2, capture)
        due_s = time.perf_counter()
        while self._is_current(generation):
            if pace_s > 0.0:
                due_s += pace_s
                self._closing.wait(max(0.0, due_s - time.perf_counter()))
            self._reading_since_s = time.perf_counter()
            if not capture.grab():
                return
            grabbed_s = time.perf_counter()
            done, picture = capture.retrieve()
            if not done or picture is None:
                return
            image = to_grey(picture)
            repeated = before is not None and not self._settings.repeats_count and np.array_equal(image, before)
            before = image
            if self._is_current(generation):
                self._publish(image, grabbed_s, float(capture.get(cv2.CAP_PROP_POS_MSEC)), repeated)

    def _publish(self, image: NDArray[np.uint8], grabbed_s: float, position_ms: float, repeated: bool) -> None:
        with self._news:
            if repeated:
                self._repeated += 1
                return
            if self._frames_per_s is not None and self._grabbed > 0:
                self._missed += max(0, round((grabbed_s - self._fresh_s) * self._frames_per_s) - 1)
            if self._has_news():
                self._skipped += 1
            self._grabbed += 1
            self._fresh_s = grabbed_s
            skipped = self._grabbed - self._fetched - 1
            self._newest = Frame(image, self._grabbed, grabbed_s, position_ms, skipped)
            self._news.notify_all()

    def _pace_s(self, cv2: object, capture: object) -> float:
        """A file is read as fast as it was taken, so that it stands in for a camera."""
        if kind_of(self._source) != FILE:
            return 0.0
        rate = self._frames_per_s or capture.get(cv2.CAP_PROP_FPS)  # pyright: ignore[reportAttributeAccessIssue]
        return 1.0 / rate if rate > 0.0 else 0.0


def to_grey(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture as (height, width): colour becomes luminance by ITU-R BT.601, grey stays as it is."""
    if picture.ndim == 2:
        return picture
    if picture.shape[2] == 1:
        return np.ascontiguousarray(picture[:, :, 0])
    cv2 = import_cv2()
    return cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
