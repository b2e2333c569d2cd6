"""What a pixel is worth: scale, its uncertainty and the lens's radial distortion, kept in a TOML file."""

import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Self

from bender_loop.bounds import ANY, FROM_0, check_numbers
from bender_loop.errors import InputError
from bender_loop.shell.files import write_atomically
from bender_loop.shell.toml_file import read_toml_file

_BOUNDS = {
    "um_per_px": (1e-4, 1e4),
    "uncertainty": FROM_0,
    "distortion": (-0.3, 0.3),
    "width_px": (1, 1e6),
    "height_px": (1, 1e6),
    "centre_x_px": ANY,
    "centre_y_px": ANY,
    "residual_um": FROM_0,
    "pitch_um": FROM_0,
}


@dataclass(frozen=True, slots=True)
class Calibration:
    """How pixels become micrometres.

    With (x, y) from the centre of the distortion and r its length over the picture's half diagonal, the place in
    micrometres is `um_per_px * (1 + distortion * r^2) * (x, y)`: the one-term radial model of Brown, Photogrammetric
    Engineering 37 (1971), 855, written from picture to object so that nothing has to be solved.

    Attributes:
        um_per_px: scale at the centre, um.
        uncertainty: standard uncertainty of the scale, um per pixel; 0 where it is unknown.
        distortion: relative growth of the scale's integral at the corner of the picture, 0 for a perfect lens.
        width_px, height_px: of the picture that it holds for.
        centre_x_px, centre_y_px: of the distortion, in pixels with (0, 0) the middle of the first pixel.
        residual_um: rms distance of the marks from the model that was fitted, um.
        pitch_um: distance of the marks that were looked at, um; 0 for a scale that was told.
        source: where the figures come from.
    """

    um_per_px: float
    uncertainty: float
    distortion: float
    width_px: int
    height_px: int
    centre_x_px: float
    centre_y_px: float
    residual_um: float = 0.0
    pitch_um: float = 0.0
    source: str = "told"

    def __post_init__(self) -> None:
        if not isinstance(self.source, str):
            raise ValueError(f"source: found {self.source!r}, expected a string")
        check_numbers(self, _BOUNDS, whole=("width_px", "height_px"))

    @classmethod
    def of_scale(cls, um_per_px: float, width_px: int = 640, height_px: int = 480) -> Self:
        """A scale known from elsewhere, without distortion and with its uncertainty unknown."""
        return cls(um_per_px, 0.0, 0.0, width_px, height_px, (width_px - 1) / 2, (height_px - 1) / 2)

    @property
    def radius_px(self) -> float:
        """Half the diagonal of the picture, px."""
        return math.hypot(self.width_px, self.height_px) / 2

    def to_um(self, x_px: float, y_px: float) -> tuple[float, float]:
        """Where the pixel position lies from the distortion's centre, um."""
        x, y = x_px - self.centre_x_px, y_px - self.centre_y_px
        factor = self.um_per_px * (1.0 + self.distortion * (x * x + y * y) / self.radius_px**2)
        return factor * x, factor * y

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """Read a file that `save` wrote.

        Raises:
            InputError: there is no such file, it is not TOML, or a key is missing, unknown or out of its bounds.
        """
        path = Path(path)
        table = _read_table(path)
        known = {field.name for field in fields(cls)}
        needed = known - {"residual_um", "pitch_um", "source"}
        if unknown := sorted(set(table) - known):
            raise InputError(f"{path}: found the unknown key {unknown[0]!r}, expected {', '.join(sorted(known))}")
        if missing := sorted(needed - set(table)):
            raise InputError(f"{path}: the key {missing[0]!r} is missing; make the file with: bender calibrate")
        try:
            return cls(**table)
        except (TypeError, ValueError) as error:
            raise InputError(f"{path}: {error}") from None

    def save(self, path: Path | str) -> None:
        """Write a TOML file that `load` reads, whole or not at all.

        Raises:
            InputError: the file cannot be written.
        """
        import tomli_w

        write_atomically(Path(path), tomli_w.dumps({"calibration": asdict(self)}))


def _read_table(path: Path) -> dict[str, Any]:
    document = read_toml_file(path, "a calibration that bender calibrate wrote")
    table = document.get("calibration")
    if not isinstance(table, dict) or set(document) != {"calibration"}:
        raise InputError(f"{path}: expected the one table [calibration]; make the file with: bender calibrate")
    return table
