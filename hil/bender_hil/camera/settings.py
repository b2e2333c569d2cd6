"""What is asked of a camera."""

from dataclasses import dataclass

from bender_loop.bounds import check_numbers

BACKENDS = ("auto", "ffmpeg", "v4l2", "dshow", "msmf")
_DRIVER = (-1e9, 1e9)
"""In units of the driver, whatever those are."""
_BOUNDS = {
    "width_px": (1, 1e5),
    "height_px": (1, 1e5),
    "exposure": _DRIVER,
    "gain": _DRIVER,
    "white_balance": _DRIVER,
    "read_timeout_s": (0.01, 60.0),
    "reopen_pause_s": (0.001, 60.0),
    "open_timeout_s": (0.01, 600.0),
}


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """How a source is opened and what is locked on it.

    Exposure, gain and white balance are in the units of the driver (V4L2: 100 us, DSHOW: powers of two of a second).
    What is None is left as the driver has it.

    Attributes:
        backend: of OpenCV: auto (ffmpeg for files and addresses, the platform's own for a device), ffmpeg, v4l2,
            dshow or msmf.
        width_px, height_px: asked of a device.
        exposure, gain, white_balance: fixed values; the automatic of each is switched off first.
        pixel_format: four letters, such as MJPG or YUYV, asked of a device.
        read_timeout_s: how long a stream may be silent before it is opened anew.
        reopen_pause_s: between two attempts to open it anew.
        open_timeout_s: how long opening an address may take.
        repeats_count: whether a picture that equals the last one in every pixel is a new frame. A sensor's noise
            never repeats, so such a picture tells of a frozen driver; a noiseless source needs True.
    """

    backend: str = "auto"
    width_px: int | None = None
    height_px: int | None = None
    exposure: float | None = None
    gain: float | None = None
    white_balance: float | None = None
    pixel_format: str | None = None
    read_timeout_s: float = 0.3
    reopen_pause_s: float = 0.1
    open_timeout_s: float = 3.0
    repeats_count: bool = False

    def __post_init__(self) -> None:
        if self.backend not in BACKENDS:
            raise ValueError(f"backend: found {self.backend!r}, expected one of {', '.join(BACKENDS)}")
        if not isinstance(self.repeats_count, bool):
            raise ValueError(f"repeats_count: found {self.repeats_count!r}, expected true or false")
        check_numbers(self, _BOUNDS, whole=("width_px", "height_px"))
        if self.pixel_format is not None and (
            not isinstance(self.pixel_format, str) or len(self.pixel_format.encode()) != 4
        ):
            raise ValueError(f"pixel_format: found {self.pixel_format!r}, expected four letters such as MJPG")
