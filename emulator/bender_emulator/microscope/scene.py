"""The picture that the emulated camera takes of the wire's tip.

The wire is a half strip, so its blurred picture is a product of two profiles, one across and one along: a pixel costs
two look-ups, and what does not move is drawn once.
"""

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_emulator.microscope.backdrop import backdrop
from bender_emulator.microscope.optics import Table, bar, step
from bender_emulator.microscope.settings import SceneSettings

_HALO_WIDTH = 2.5
_GLINT_PLACE, _GLINT_WIDTH = 0.17, 0.16
_NOISE_MARGIN = 96
_SMEAR_STEP_PX = 0.02
_NO_WIRE = (slice(0, 0), slice(0, 0))


class Scene:
    """Draws the tip of the wire where it is told.

    Args:
        settings: what is to be seen.
        rng: places the dirt and makes the noise.
    """

    def __init__(self, settings: SceneSettings, rng: np.random.Generator) -> None:
        self.settings = settings
        self._rng = rng
        self._backdrop = backdrop(settings, rng)
        shape = self._backdrop.shape
        self._grain = rng.standard_normal((shape[0] + _NOISE_MARGIN, shape[1] + _NOISE_MARGIN)).astype(np.float32)
        self._noise = self._noise_of(self._backdrop)
        x, y = _undistorted(settings)
        self._x, self._y = x.astype(np.float32), y.astype(np.float32)
        self._across = lru_cache(maxsize=512)(self._across_table)
        self._along = self._along_table()
        self._sum = np.empty_like(self._backdrop)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the picture, px."""
        return self._backdrop.shape[0], self._backdrop.shape[1]

    def render(self, tip_um: float, tip_velocity_um_per_s: float = 0.0, exposure_s: float = 0.0) -> NDArray[np.uint8]:
        """The picture, (height, width), with noise.

        Args:
            tip_um: where the tip is in the middle of the exposure.
            tip_velocity_um_per_s: how fast it moves; it smears the wire by velocity times exposure.
            exposure_s: how long the shutter is open.
        """
        smear_px = abs(tip_velocity_um_per_s * exposure_s) / self.settings.um_per_px
        return self._noisy(*self._wire(tip_um, smear_px))

    def _noisy(self, where: tuple[slice, slice], wire: NDArray[np.float32]) -> NDArray[np.uint8]:
        """The picture with a wire in a part of it, with noise."""
        row, column = self._rng.integers(0, _NOISE_MARGIN, 2)
        height, width = self.shape
        grain = self._grain[row : row + height, column : column + width]
        np.multiply(self._noise, grain, out=self._sum)
        self._sum += self._backdrop
        if wire.size:
            self._sum[where] = wire + self._noise_of(wire) * grain[where]
        return self._developed(self._sum)

    def clean(self, tip_um: float, smear_px: float = 0.0) -> NDArray[np.float32]:
        """The picture without noise, in levels."""
        where, wire = self._wire(tip_um, smear_px)
        picture = self._backdrop.copy()
        picture[where] = wire
        return picture

    @property
    def light(self) -> NDArray[np.float32]:
        """The picture without wire and noise, in levels."""
        return self._backdrop

    def object_um(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """For every pixel, how far what is seen there lies from the picture's middle, x and y."""
        height, width = self.shape
        scale = self.settings.um_per_px
        x, y = _undistorted(self.settings)
        return (x - 0.5 * (width - 1)) * scale, (y - 0.5 * (height - 1)) * scale

    def develop(self, levels: NDArray[np.floating]) -> NDArray[np.uint8]:
        """The picture that the sensor makes of any light: with noise, in whole levels."""
        height, width = self.shape
        row, column = self._rng.integers(0, _NOISE_MARGIN, 2)
        grain = self._grain[row : row + height, column : column + width]
        exact: NDArray[np.float32] = levels.astype(np.float32)
        exact += self._noise_of(exact) * grain
        return self._developed(exact)

    def tip_px(self, tip_um: float) -> tuple[float, float]:
        """Where the middle of the wire's end is, x and y in pixels of a lens without distortion."""
        angle = math.radians(self.settings.rest_angle_deg)
        moved_px = tip_um / self.settings.um_per_px
        return (
            self.settings.rest_x_px - math.sin(angle) * moved_px,
            self.settings.rest_y_px + math.cos(angle) * moved_px,
        )

    def _wire(self, tip_um: float, smear_px: float) -> tuple[tuple[slice, slice], NDArray[np.float32]]:
        """Where the picture changes by the wire, and what it is there."""
        settings = self.settings
        tip_x, tip_y = self.tip_px(tip_um)
        angle = math.radians(settings.rest_angle_deg) + settings.rotation_rad_per_um * tip_um
        where = self._region(tip_x, tip_y, angle, smear_px)
        x, y = self._x[where] - np.float32(tip_x), self._y[where] - np.float32(tip_y)
        if not x.size:
            return _NO_WIRE, np.empty((0, 0), np.float32)
        cosine, sine = np.float32(math.cos(angle)), np.float32(math.sin(angle))
        across = self._across(round(smear_px / _SMEAR_STEP_PX))
        shade = across(y * cosine - x * sine)
        shade *= self._along(x * cosine + y * sine)
        np.subtract(np.float32(1.0), shade, out=shade)
        shade *= self._backdrop[where]
        return where, shade

    def _region(self, tip_x: float, tip_y: float, angle: float, smear_px: float) -> tuple[slice, slice]:
        """Rows and columns that hold the wire with its blur."""
        height, width = self.shape
        margin = self._reach_px(smear_px) + abs(self.settings.distortion) * math.hypot(width, height)
        if abs(math.cos(angle)) < 0.5:
            return slice(0, height), slice(0, width)
        left_y = tip_y - math.tan(angle) * tip_x
        low, high = min(tip_y, left_y) - margin, max(tip_y, left_y) + margin
        rows = slice(*(int(min(max(row, 0), height)) for row in (low, high + 1)))
        return rows, slice(0, int(min(max(tip_x + margin, 0), width)))

    def _reach_px(self, smear_px: float = 0.0) -> float:
        blur = math.hypot(self.settings.blur_px, 0.3)
        return self.settings.wire_um / self.settings.um_per_px / 2 + smear_px / 2 + 5.0 * _HALO_WIDTH * blur + 2.0

    def _across_table(self, smear_steps: int) -> Table:
        settings, smear_px = self.settings, smear_steps * _SMEAR_STEP_PX
        width_px = settings.wire_um / settings.um_per_px
        reach = self._reach_px(smear_px)
        place = Table.places(reach)
        dark = bar(place, width_px, settings.blur_px, smear_px)
        halo = bar(place, width_px, _HALO_WIDTH * settings.blur_px, smear_px)
        glint = bar(place - _GLINT_PLACE * width_px, _GLINT_WIDTH * width_px, settings.blur_px, smear_px)
        profile = (1.0 + settings.halo) * dark - settings.halo * halo - settings.glint * glint
        return Table(settings.opacity * profile, reach)

    def _along_table(self) -> Table:
        reach = self._reach_px()
        return Table(step(-Table.places(reach), self.settings.blur_px), reach)

    def _noise_of(self, levels: NDArray[np.float32]) -> NDArray[np.float32]:
        share = np.maximum(levels, 4.0) / np.float32(self.settings.light_levels)
        return np.sqrt(share, dtype=np.float32) * np.float32(self.settings.noise_levels)

    def _developed(self, levels: NDArray[np.float32]) -> NDArray[np.uint8]:
        np.add(levels, np.float32(0.5), out=levels)
        np.clip(levels, 0.0, 255.0, out=levels)
        picture = levels.astype(np.uint8)
        return _through_jpeg(picture, self.settings.jpeg_quality) if self.settings.jpeg_quality else picture


def _undistorted(settings: SceneSettings) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """For every pixel, where it would be with a lens without distortion."""
    y, x = np.indices((settings.height_px, settings.width_px), dtype=np.float64)
    centre_x, centre_y = (settings.width_px - 1) / 2, (settings.height_px - 1) / 2
    x -= centre_x
    y -= centre_y
    corner = (settings.width_px**2 + settings.height_px**2) / 4
    factor = 1.0 + settings.distortion * (x * x + y * y) / corner
    return x * factor + centre_x, y * factor + centre_y


def _through_jpeg(picture: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    from bender_loop.shell.opencv import import_cv2

    cv2: Any = import_cv2()
    _, packed = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE)
