"""Pictures of the ruler: from files, from a camera, or drawn."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bender_hil.calibration.fit import RulerFit
from bender_hil.camera.reader import Camera, to_grey
from bender_loop.errors import InputError, RunError
from bender_loop.shell.bounded import read_bounded
from bender_loop.shell.opencv import import_cv2
from bender_loop.shell.silence import STANDARD_ERROR, silence_below_python

Picture = NDArray[np.uint8]

_FRAME_TIMEOUT_S = 2.0
_MARKED_LINES = 10
_MOST_BYTES = 1 << 28


def read_picture(path: Path) -> Picture:
    """A picture file as (height, width), grey.

    Raises:
        InputError: there is no such file, or it is no picture.
    """
    cv2 = import_cv2()
    data = np.frombuffer(read_bounded(path, _MOST_BYTES, "a picture"), np.uint8)
    # the decoders of PNG and JPEG complain on the standard error by themselves
    with silence_below_python(STANDARD_ERROR):
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    if picture is None:
        raise InputError(f"{path}: found no picture, expected PNG, TIFF, BMP or JPEG")
    return to_grey(picture)


def take_picture(source: str | int, frames: int) -> Picture:
    """The mean of some frames of a camera, (height, width).

    Raises:
        InputError: the camera cannot be opened.
        RunError: it sends no frames, or their size changes.
    """
    total: NDArray[np.float64] | None = None
    with Camera(source) as camera:
        for taken in range(frames):
            frame = camera.newest(_FRAME_TIMEOUT_S)
            if frame is None:
                raise RunError(
                    f"camera {source}: frame {taken + 1} of {frames} did not come within {_FRAME_TIMEOUT_S} s"
                )
            if total is not None and total.shape != frame.image.shape:
                raise RunError(f"camera {source}: the size of its frames changed")
            total = frame.image.astype(np.float64) if total is None else total + frame.image
    if total is None:
        raise InputError(f"frames: found {frames}, expected 1 or more")
    return np.rint(total / frames).astype(np.uint8)


def draw_pictures(seed: int) -> list[Picture]:
    """The emulated microscope's own pictures of a ruler, along and across."""
    from bender_emulator.microscope import Scene, SceneSettings
    from bender_emulator.microscope.micrometer import render_micrometer

    scene = Scene(SceneSettings(), np.random.default_rng(seed))
    return [render_micrometer(scene, angle_deg=angle) for angle in (0.6, 90.4)]


def marked(pictures: Sequence[Picture], fit: RulerFit) -> bytes:
    """A PNG of the pictures, side by side, with every tenth line of the fit drawn over the ruler in red.

    Whoever sees the red lines drift off the ruler's knows that the fit is not to be used.
    """
    cv2 = import_cv2()
    panels = [_marked_one(picture, fit, index) for index, picture in enumerate(pictures)]
    done, data = cv2.imencode(".png", np.hstack(panels))
    if not done:
        raise RunError("the marked picture could not be packed as PNG")
    return data.tobytes()


def _marked_one(picture: Picture, fit: RulerFit, index: int) -> Picture:
    calibration = fit.calibration
    y, x = np.indices(picture.shape, dtype=np.float64)
    x_um, y_um = calibration.to_um(x, y)
    angle = np.deg2rad(fit.angles_deg[index])
    along_um = x_um * np.cos(angle) + y_um * np.sin(angle)
    # A dark line is a trough of the wave: the phase of its middle is a half turn.
    lines = along_um / calibration.pitch_um + (fit.phases_rad[index] - np.pi) / (2.0 * np.pi)
    off_um = np.abs(lines - _MARKED_LINES * np.rint(lines / _MARKED_LINES)) * calibration.pitch_um
    coloured = np.repeat(picture[:, :, None], 3, axis=2)
    coloured[off_um < 0.5 * calibration.um_per_px] = (0, 0, 255)
    return coloured
