"""Scale and distortion from the phase of a ruler's lines in one or more pictures."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from bender_hil.calibration.fringes import Fringes
from bender_hil.calibration.growth import growth_fit
from bender_loop.errors import InputError
from bender_vision.scale import Calibration

Values = NDArray[np.float64]

MODEL_UNCERTAINTY = 1e-4
"""Relative standard uncertainty for what the model leaves out: one term of distortion, centred, no tilt."""

_FEWEST_PLACES = 20
_DOUBTED_RAD = 0.05
_LARGEST_RESIDUAL_RAD = 0.6


@dataclass(frozen=True, slots=True)
class RulerFit:
    """What the pictures of a ruler say.

    Attributes:
        calibration: the result.
        angles_deg: direction in which the lines are counted, for each picture.
        lone_um_per_px: scale of each picture by itself, with the common distortion.
        phases_rad: phase of the fit at the distortion's centre, for each picture.
        places: how many places of the pictures were used.
    """

    calibration: Calibration
    angles_deg: tuple[float, ...]
    lone_um_per_px: tuple[float, ...]
    phases_rad: tuple[float, ...]
    places: int


def fit_ruler(pictures: Sequence[Fringes], pitch_um: float, ruler_uncertainty: float, source: str) -> RulerFit:
    """Fit one scale and one distortion to all pictures, a direction and a phase to each.

    Args:
        pictures: of one size.
        pitch_um: distance of the ruler's lines.
        ruler_uncertainty: relative standard uncertainty of that distance, from the ruler's certificate.
        source: what to note down as the origin.

    Raises:
        InputError: the pictures differ in size, or too few places show clear lines, or no fit describes them.
    """
    if len({picture.shape for picture in pictures}) != 1:
        sizes = ", ".join(f"{picture.shape[1]} x {picture.shape[0]}" for picture in pictures)
        raise InputError(f"pictures: found the sizes {sizes}, expected one size")
    if any(len(picture.x_px) < _FEWEST_PLACES for picture in pictures):
        raise InputError("pictures: found clear lines in too small a part; fill the picture with the ruler and focus")
    solved = _Problem(pictures).solve()
    parameters = solved.x
    rms_rad = float(1.4826 * np.median(np.abs(solved.fun)))
    if rms_rad > _LARGEST_RESIDUAL_RAD:
        raise InputError("pictures: no straight evenly spaced lines fit; is the ruler flat and in focus everywhere?")
    height, width = pictures[0].shape
    wave = float(math.exp(parameters[0]))
    um_per_px = wave * pitch_um / (2.0 * math.pi)
    relative = math.hypot(relative_spread(solved), ruler_uncertainty, MODEL_UNCERTAINTY)
    calibration = Calibration(
        um_per_px, um_per_px * relative, float(parameters[1]), width, height, (width - 1) / 2, (height - 1) / 2,
        rms_rad * pitch_um / (2.0 * math.pi), pitch_um, source,
    )  # fmt: skip
    lone = tuple(
        math.exp(_Problem([picture], float(parameters[1])).solve().x[0]) * pitch_um / (2.0 * math.pi)
        for picture in pictures
    )
    angles = tuple(math.degrees(angle) for angle in parameters[2::2])
    return RulerFit(calibration, angles, lone, tuple(float(phase) for phase in parameters[3::2]), len(solved.fun))


class _Problem:
    """Parameters: log of the wave number (rad per px), distortion, then direction and phase of each picture.

    Args:
        pictures: of one size.
        distortion: held at this value; None leaves it free.
    """

    def __init__(self, pictures: Sequence[Fringes], distortion: float | None = None) -> None:
        self._pictures = pictures
        self._distortion = distortion
        height, width = pictures[0].shape
        corner = (width**2 + height**2) / 4
        self._x = [picture.x_px - (width - 1) / 2 for picture in pictures]
        self._y = [picture.y_px - (height - 1) / 2 for picture in pictures]
        self._radius2 = [(x * x + y * y) / corner for x, y in zip(self._x, self._y, strict=True)]
        # The mean of x r^2 over a Gaussian is x (r^2 + 4 sigma^2): the smoothing leans on the distortion.
        self._smoothed2 = [4.0 * picture.smoothing_px**2 / corner for picture in pictures]

    def start(self) -> Values:
        """Parameters from the growth of the phase between neighbours, which knows of no turns."""
        found = [growth_fit(picture, x, y, radius2) for picture, x, y, radius2 in self._views()]
        distortion = float(np.mean([k for _, _, k in found])) if self._distortion is None else self._distortion
        parameters = [float(np.mean([math.log(math.hypot(*wave[:2])) for wave in found])), distortion]
        for (wave_x, wave_y, _), (picture, x, y, radius2) in zip(found, self._views(), strict=True):
            turn = picture.phase_rad - (wave_x * x + wave_y * y) * (1.0 + distortion * radius2)
            parameters += [math.atan2(wave_y, wave_x), float(np.angle(np.exp(1j * turn).sum()))]
        return np.array(parameters)

    def _views(self) -> Iterator[tuple[Fringes, Values, Values, Values]]:
        return zip(self._pictures, self._x, self._y, self._radius2, strict=True)

    def residuals(self, parameters: Values) -> Values:
        """Wrapped phase differences."""
        wave = math.exp(parameters[0])
        distortion = parameters[1] if self._distortion is None else self._distortion
        found = []
        for index, (picture, x, y, radius2) in enumerate(self._views()):
            angle, phase = parameters[2 + 2 * index], parameters[3 + 2 * index]
            bent = 1.0 + distortion * (radius2 + self._smoothed2[index])
            model = wave * (x * math.cos(angle) + y * math.sin(angle)) * bent + phase
            found.append(np.angle(np.exp(1j * (picture.phase_rad - model))))
        return np.concatenate(found)

    def solve(self) -> OptimizeResult:
        """The fit; places that dirt has spoiled count little."""
        return least_squares(self.residuals, self.start(), loss="soft_l1", f_scale=_DOUBTED_RAD, x_scale="jac")


def relative_spread(solved: OptimizeResult) -> float:
    """Relative standard deviation of the scale that the scatter of the phases leaves."""
    freedom = max(1, solved.jac.shape[0] - solved.jac.shape[1])
    variance = 2.0 * solved.cost / freedom
    return float(math.sqrt(variance * np.linalg.pinv(solved.jac.T @ solved.jac)[0, 0]))
