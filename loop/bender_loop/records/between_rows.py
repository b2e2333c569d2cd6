"""What happens between the rows: a voltage that is band-limited there, and readings that integrate over an exposure."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PIECES_PER_ROW = 8
"""A smooth voltage is followed in this many straight pieces between two rows, and through its turning points."""
_GAP = 4.0
"""Rows further apart than so many usual ones are no samples of a smooth course: the voltage runs straight there."""


def followed(time_s: Array, voltage_V: Array, pieces: int = PIECES_PER_ROW) -> tuple[Array, Array]:
    """Return instants and voltages, each (m,), between which a smooth voltage runs straight.

    Args:
        time_s: (n,) instants of the samples, increasing.
        voltage_V: (n,) samples.
        pieces: between two samples; the turning points of the course are among their ends besides.
    """
    usual = float(np.median(np.diff(time_s)))
    ends = np.flatnonzero(np.diff(time_s) > _GAP * usual) + 1
    parts = [_splined(t, v, pieces) for t, v in zip(np.split(time_s, ends), np.split(voltage_V, ends), strict=True)]
    return np.concatenate([t for t, _ in parts]), np.concatenate([v for _, v in parts])


def _splined(time_s: Array, voltage_V: Array, pieces: int) -> tuple[Array, Array]:
    from scipy.interpolate import CubicSpline

    if time_s.size < 3:
        return time_s, voltage_V
    spline = CubicSpline(time_s, voltage_V)
    parts = np.arange(pieces) / pieces
    dense = (time_s[:-1, None] + np.diff(time_s)[:, None] * parts).ravel()
    turns = np.asarray(spline.derivative().roots(extrapolate=False), dtype=np.float64)
    instants = np.unique(np.concatenate([dense, time_s[-1:], turns[np.isfinite(turns)]]))
    apart = np.append(True, np.diff(instants) > 1e-9 * np.diff(time_s).min())
    return instants[apart], np.asarray(spline(instants[apart]), dtype=np.float64)


_PARTS = 16


@dataclass(frozen=True, slots=True, eq=False)
class Exposed:
    """Instants at which a plant is read, and what becomes of what was read there.

    Attributes:
        instants_s: (m,) increasing.
        places: (n,) or (n, 17), where the instants of every reading are.
    """

    instants_s: Array
    places: NDArray[np.intp]

    def readings(self, values: Array) -> Array:
        """Return the readings (n,) of values at the instants: Simpson's mean over each exposure."""
        if self.places.ndim == 1:
            return values[self.places]
        weights = np.ones(_PARTS + 1)
        weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
        return values[self.places] @ (weights / weights.sum())


def exposed(time_s: Array, exposure_s: float = 0.0, others_s: tuple[Array, ...] = ()) -> Exposed:
    """Return the instants at which a plant is read so that readings around `time_s` follow, others among them."""
    nodes = time_s
    if exposure_s > 0.0:
        nodes = time_s[:, None] + exposure_s * (np.arange(_PARTS + 1) / _PARTS - 0.5)
    instants = np.unique(np.concatenate([nodes.ravel(), *others_s]))
    return Exposed(instants, np.searchsorted(instants, nodes))
