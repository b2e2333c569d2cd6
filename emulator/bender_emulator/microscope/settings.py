"""What the emulated microscope sees and how badly."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Self

from bender_loop.bounds import check_numbers

_PART = (0.0, 1.0)
_COUNT = (0, 500)
_PLACE = (-1e5, 1e5)
_MOST_PIXELS = 5_000_000
_BOUNDS = {
    "width_px": (96, 8192), "height_px": (64, 8192), "um_per_px": (1e-3, 1e3), "distortion": (-0.1, 0.1),
    "wire_um": (0.01, 1e5), "rest_x_px": _PLACE, "rest_y_px": _PLACE, "rest_angle_deg": (-30.0, 30.0),
    "rotation_rad_per_um": (-0.01, 0.01), "light_levels": (1.0, 1000.0), "light_slope": _PART, "vignette": _PART,
    "opacity": _PART, "halo": _PART, "glint": _PART, "blur_px": (0.0, 50.0), "noise_levels": (0.0, 200.0),
    "dust": _COUNT, "specks": _COUNT, "fibres": _COUNT, "jpeg_quality": (0, 100),
}  # fmt: skip
_WHOLE = ("width_px", "height_px", "dust", "specks", "fibres", "jpeg_quality")


@dataclass(frozen=True, slots=True)
class SceneSettings:
    """A wire at the end of the actuator, its light and its dirt.

    The wire enters from the left and ends in the tip, cut square. The tip moves across the wire's direction at rest;
    a positive displacement goes down the picture.

    Attributes:
        width_px, height_px: of the picture.
        um_per_px: scale at the picture's centre.
        distortion: radial.
        wire_um: diameter of the wire.
        rest_x_px, rest_y_px: where the tip is at rest, in pixels of a lens without distortion.
        rest_angle_deg: how the wire lies at rest; positive leans down towards the tip.
        rotation_rad_per_um: how far the tip turns as it moves.
        light_levels: brightness in the middle, of 255.
        light_slope: brightness lost from one side to the other, as a fraction.
        vignette: brightness lost in the corners, as a fraction.
        opacity: light that the wire takes away.
        halo: bright rim beside the wire's edges, a fraction of its darkness.
        glint: bright line within the wire, off its middle, a fraction of its darkness.
        blur_px: standard deviation of the optics' blur.
        noise_levels: standard deviation of the sensor's noise at full light; it falls with the root of the light.
        dust, specks, fibres: how many soft discs, sharp grains and hairs lie about.
        jpeg_quality: 1 to 100 sends every picture through JPEG; 0 does not.
    """

    width_px: int = 640
    height_px: int = 480
    um_per_px: float = 1.5
    distortion: float = 0.0
    wire_um: float = 15.0
    rest_x_px: float = 400.0
    rest_y_px: float = 240.0
    rest_angle_deg: float = 1.0
    rotation_rad_per_um: float = 6.4e-4
    light_levels: float = 190.0
    light_slope: float = 0.12
    vignette: float = 0.2
    opacity: float = 0.72
    halo: float = 0.06
    glint: float = 0.15
    blur_px: float = 1.2
    noise_levels: float = 3.0
    dust: int = 6
    specks: int = 6
    fibres: int = 0
    jpeg_quality: int = 0

    def __post_init__(self) -> None:
        check_numbers(self, _BOUNDS, whole=_WHOLE)
        if self.width_px * self.height_px > _MOST_PIXELS:
            found = f"{self.width_px} x {self.height_px}"
            raise ValueError(f"width_px, height_px: found {found}, expected at most {_MOST_PIXELS} pixels together")

    @classmethod
    def from_table(cls, table: Mapping[str, object]) -> Self:
        """Settings from a bench file's table.

        Raises:
            ValueError: a key is unknown or a value is out of its bounds.
        """
        known = [field.name for field in fields(cls)]
        if unknown := sorted(set(table) - set(known)):
            raise ValueError(f"{unknown[0]}: unknown, expected one of {', '.join(known)}")
        return cls(**table)  # pyright: ignore[reportArgumentType]
