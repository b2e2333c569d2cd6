"""Opening a source of frames with OpenCV: a device by number, a file, or a stream's address."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bender_hil.camera.settings import CameraSettings
from bender_loop.errors import InputError
from bender_loop.shell.opencv import import_cv2

DEVICE, FILE, STREAM = "device", "file", "stream"


@dataclass(frozen=True, slots=True)
class Opened:
    """A source that is open.

    Attributes:
        capture: the `cv2.VideoCapture`.
        backend: OpenCV's name of what reads it.
        accepted: by property, what was asked and what the driver then reported, for the log.
    """

    capture: Any
    backend: str
    accepted: Mapping[str, tuple[float, float]]


def parse_source(source: str | int) -> str | int:
    """The device number that a string of digits is, or the string itself."""
    return int(source) if isinstance(source, str) and source.isdecimal() else source


def kind_of(source: str | int) -> str:
    """DEVICE, FILE or STREAM."""
    source = parse_source(source)
    if isinstance(source, int) or source.startswith("/dev/"):
        return DEVICE
    return STREAM if "://" in source else FILE


def open_source(source: str | int, settings: CameraSettings, frames_per_s: float | None) -> Opened:
    """Open a source and lock on it what the settings ask for.

    Raises:
        InputError: nothing answers there, or this platform lacks the backend.
    """
    cv2 = import_cv2()
    source, kind = parse_source(source), kind_of(source)
    if kind == FILE and not Path(str(source)).is_file():
        raise InputError(
            f"camera {source}: found no such file; expected a device number, a file, or an address such as tcp://host:port"
        )
    backend = _backend(cv2, settings.backend, kind)
    parameters: list[int] = []
    if backend == cv2.CAP_FFMPEG:
        parameters = [
            cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, round(1000 * settings.open_timeout_s),
            cv2.CAP_PROP_READ_TIMEOUT_MSEC, round(1000 * settings.read_timeout_s),
        ]  # fmt: skip
    capture = cv2.VideoCapture(source, backend, parameters)
    if not capture.isOpened():
        capture.release()
        raise InputError(f"camera {source}: cannot be opened; {_advice(kind)}")
    accepted = _lock(cv2, capture, settings, frames_per_s) if kind == DEVICE else {}
    return Opened(capture, capture.getBackendName(), accepted)


def _backend(cv2: Any, name: str, kind: str) -> int:
    if name == "auto":
        if kind != DEVICE:
            return cv2.CAP_FFMPEG
        return cv2.CAP_V4L2 if sys.platform.startswith("linux") else cv2.CAP_ANY
    number = {"ffmpeg": cv2.CAP_FFMPEG, "v4l2": cv2.CAP_V4L2, "dshow": cv2.CAP_DSHOW, "msmf": cv2.CAP_MSMF}[name]
    if number not in cv2.videoio_registry.getBackends():
        have = ", ".join(cv2.videoio_registry.getBackendName(found).lower() for found in _known(cv2))
        raise InputError(f"backend: found {name!r}, but OpenCV on this machine has only: {have}; take one or auto")
    return number


def _known(cv2: Any) -> list[int]:
    return [number for number in cv2.videoio_registry.getBackends() if number != cv2.CAP_IMAGES]


def _advice(kind: str) -> str:
    return {
        DEVICE: "check that it is plugged in, that no other program has it, and its number",
        STREAM: "check that something serves there and that no other client has it",
        FILE: "expected a video that OpenCV reads",
    }[kind]


def _lock(
    cv2: Any, capture: Any, settings: CameraSettings, frames_per_s: float | None
) -> dict[str, tuple[float, float]]:
    """Ask for every property that was set; drivers refuse silently, so what holds afterwards is read back."""
    # V4L2's menu calls manual exposure 1; elsewhere the property is a plain yes or no
    manual = 1.0 if capture.getBackendName() == "V4L2" else 0.0
    code = settings.pixel_format
    wanted: list[tuple[str, int, float | None]] = [
        ("pixel_format", cv2.CAP_PROP_FOURCC, None if code is None else cv2.VideoWriter.fourcc(*code)),
        ("width_px", cv2.CAP_PROP_FRAME_WIDTH, settings.width_px),
        ("height_px", cv2.CAP_PROP_FRAME_HEIGHT, settings.height_px),
        ("frames_per_s", cv2.CAP_PROP_FPS, frames_per_s),
        # a frame that waits in the driver is an old frame
        ("buffered_frames", cv2.CAP_PROP_BUFFERSIZE, 1),
        ("auto_exposure", cv2.CAP_PROP_AUTO_EXPOSURE, None if settings.exposure is None else manual),
        ("exposure", cv2.CAP_PROP_EXPOSURE, settings.exposure),
        ("gain", cv2.CAP_PROP_GAIN, settings.gain),
        ("auto_white_balance", cv2.CAP_PROP_AUTO_WB, None if settings.white_balance is None else 0.0),
        ("white_balance", cv2.CAP_PROP_WB_TEMPERATURE, settings.white_balance),
        ("autofocus", cv2.CAP_PROP_AUTOFOCUS, 0.0),
    ]
    for _, number, value in wanted:
        if value is not None:
            capture.set(number, float(value))
    return {name: (float(value), float(capture.get(number))) for name, number, value in wanted if value is not None}
