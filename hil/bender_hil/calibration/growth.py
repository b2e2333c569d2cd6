"""A first fit of the lines from how much the phase grows between neighbouring places."""

import numpy as np
from numpy.typing import NDArray

from bender_hil.calibration.fringes import Fringes
from bender_loop.errors import InputError

Values = NDArray[np.float64]

_ROUNDS = 4
_DOUBTED_SPREADS = 4.0
_FEWEST_PAIRS = 10


def growth_fit(picture: Fringes, x: Values, y: Values, radius2: Values) -> tuple[float, float, float]:
    """Wave vector at the centre, rad per px, and distortion.

    With the phase w.p (1 + k r^2) the growth from one place to its neighbour is linear in w and k w. Neighbours are so
    near that the growth differs from that of the mean wave by less than half a turn.

    Args:
        picture: with phases at places on a grid.
        x: of the places, from the distortion's centre, px.
        y: of the places, likewise.
        radius2: squared distance from that centre over the squared half diagonal.

    Raises:
        InputError: too few places have neighbours.
    """
    first, second = _neighbours(picture)
    if len(first) < _FEWEST_PAIRS:
        raise InputError("pictures: found clear lines in too small a part; fill the picture with the ruler and focus")
    expected = picture.wave_rad_per_px[0] * (x[second] - x[first]) + picture.wave_rad_per_px[1] * (y[second] - y[first])
    growth = expected + np.angle(np.exp(1j * (picture.phase_rad[second] - picture.phase_rad[first] - expected)))
    columns = [values[second] - values[first] for values in (x, y, x * radius2, y * radius2)]
    matrix = np.stack(columns, axis=1)
    good = np.ones(len(first), dtype=bool)
    solution = np.zeros(4)
    for _ in range(_ROUNDS):
        solution = np.linalg.lstsq(matrix[good], growth[good], rcond=None)[0]
        off = np.abs(growth - matrix @ solution)
        good = off <= max(_DOUBTED_SPREADS * 1.4826 * float(np.median(off)), 1e-6)
    wave, bent = solution[:2], solution[2:]
    return float(wave[0]), float(wave[1]), float(wave @ bent / (wave @ wave))


def _neighbours(picture: Fringes) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of places that are one step apart along x or along y."""
    apart_x = picture.x_px[None, :] - picture.x_px[:, None]
    apart_y = picture.y_px[None, :] - picture.y_px[:, None]
    step = picture.step_px
    pairs = np.nonzero(((apart_x == step) & (apart_y == 0)) | ((apart_y == step) & (apart_x == 0)))
    return pairs[0], pairs[1]
