"""What happens between the rows: a voltage that is band-limited there, and readings that integrate over an exposure."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PIECES_PER_ROW = 8
"""A smooth voltage is followed in this many straight pieces between two rows, and through its turning points."""
_OF_A_SPLINE = 3
"""Samples that a smooth course needs at least."""
_GAP = 4.0
"""Rows further apart than so many usual ones are no samples of a smooth course: the voltage runs straight there."""
_FINER, _HALF_ROWS, _KAISER_BETA = 4, 24, 8.0
"""Between even rows, a band-limited voltage is put on so many finer rows; what its interpolation sees on each side of
a row, and the window over that: true to 1e-3 up to 0.4 of the sampling rate."""
_EVEN = 0.02
"""Rows are even where none is further from its place than this part of a row."""


def followed(time_s: Array, voltage_V: Array, pieces: int = PIECES_PER_ROW) -> tuple[Array, Array]:
    """Return instants and voltages, each (m,), between which a smooth voltage runs straight.

    Between even rows the voltage is band-limited below half the sampling rate (Shannon's series under a window of
    Kaiser); between uneven ones it runs on a cubic spline, which is true to 2 % up to a tenth of the rate.

    Args:
        time_s: (n,) instants of the samples, increasing.
        voltage_V: (n,) samples.
        pieces: between two samples; the turning points of the course are among their ends besides.
    """
    parts = [_splined(t, v, pieces) for t, v in _stretches(time_s, voltage_V)]
    return np.concatenate([t for t, _ in parts]), np.concatenate([v for _, v in parts])


def course(time_s: Array, voltage_V: Array) -> Callable[[Array], Array]:
    """Return the smooth voltage itself, in V at instants in s from the first sample to the last.

    Args:
        time_s: (n,) instants of the samples, increasing; two or more.
        voltage_V: (n,) samples.
    """
    from scipy.interpolate import CubicSpline, PPoly

    nodes: list[Array] = []
    cubics: list[Array] = []
    last_V = voltage_V[:0]
    for t, v in _stretches(time_s, voltage_V):
        if nodes:
            cubics.append(_straight(np.append(nodes[-1][-1:], t[:1]), np.append(last_V, v[:1])))
        spline = CubicSpline(*_finer(t, v)) if t.size >= _OF_A_SPLINE else None
        nodes.append(t if spline is None else spline.x)
        cubics.append(_straight(t, v) if spline is None else spline.c)
        last_V = v[-1:]
    return PPoly(np.concatenate(cubics, axis=1), np.concatenate(nodes))


def _straight(time_s: Array, voltage_V: Array) -> Array:
    """Return the coefficients (4, n - 1) of straight lines between samples, as cubics."""
    none = np.zeros(time_s.size - 1)
    return np.stack([none, none, np.diff(voltage_V) / np.diff(time_s), voltage_V[:-1]])


def _stretches(time_s: Array, voltage_V: Array) -> list[tuple[Array, Array]]:
    """Return a record cut where its rows are too far apart for samples of a smooth course."""
    ends = np.flatnonzero(np.diff(time_s) > _GAP * float(np.median(np.diff(time_s)))) + 1
    return list(zip(np.split(time_s, ends), np.split(voltage_V, ends), strict=True))


def _splined(time_s: Array, voltage_V: Array, pieces: int) -> tuple[Array, Array]:
    from scipy.interpolate import CubicSpline

    if time_s.size < _OF_A_SPLINE:
        return time_s, voltage_V
    spline = CubicSpline(*_finer(time_s, voltage_V))
    parts = np.arange(pieces) / pieces
    dense = (time_s[:-1, None] + np.diff(time_s)[:, None] * parts).ravel()
    turns = np.asarray(spline.derivative().roots(extrapolate=False), dtype=np.float64)
    instants = np.unique(np.concatenate([dense, time_s[-1:], turns[np.isfinite(turns)]]))
    apart = np.append(True, np.diff(instants) > 1e-9 * np.diff(time_s).min())
    return instants[apart], np.asarray(spline(instants[apart]), dtype=np.float64)


def is_even(time_s: Array, part_of_row: float) -> bool:
    """Return whether every row (n,), of two or more, is where an even raster has it, to a part of a row."""
    even_s = np.linspace(time_s[0], time_s[-1], time_s.size)
    return bool(np.max(np.abs(time_s - even_s)) <= part_of_row * (even_s[1] - even_s[0]))


def _finer(time_s: Array, voltage_V: Array) -> tuple[Array, Array]:
    """Return a band-limited voltage on finer rows, as it is where its rows are few or uneven.

    The rows stay exact, and so does a voltage that rests: no resampling filter of a library promises both.
    """
    places = np.arange(time_s.size)
    if time_s.size <= 2 * _HALF_ROWS or not is_even(time_s, _EVEN):
        return time_s, voltage_V
    # beyond its ends the course goes on as its mirror image about them: value and slope stay
    before = 2.0 * voltage_V[0] - voltage_V[_HALF_ROWS:0:-1]
    after = 2.0 * voltage_V[-1] - voltage_V[-2 : -_HALF_ROWS - 2 : -1]
    longer = np.concatenate([before, voltage_V, after])
    rows = np.arange(-_HALF_ROWS, _HALF_ROWS + 1)
    finer = np.empty((time_s.size - 1, _FINER))
    finer[:, 0] = voltage_V[:-1]
    for k in range(1, _FINER):
        distance = k / _FINER - rows
        window = np.i0(_KAISER_BETA * np.sqrt(np.maximum(1.0 - (distance / (_HALF_ROWS + 1)) ** 2, 0.0)))
        weights = np.sinc(distance) * window
        finer[:, k] = np.convolve(longer, (weights / weights.sum())[::-1], mode="valid")[:-1]
    parts = (places[:-1, None] + np.arange(_FINER) / _FINER).ravel()
    instants = np.interp(np.append(parts, places[-1]), places, time_s)
    return instants, np.append(finer.ravel(), voltage_V[-1])


_INSTANTS = 20
"""Within an exposure. The mean of a swing of five periods is true to 1e-14 of it, that of six to 1e-9; a kink of the
slope costs 5e-4 of its change over the whole exposure at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Exposed:
    """Instants at which a plant is read, and what becomes of what was read there.

    Attributes:
        instants_s: (m,) increasing.
        places: (n,) or (n, 20), where the instants of every reading are.
    """

    instants_s: Array
    places: NDArray[np.intp]

    def readings(self, values: Array) -> Array:
        """Return the readings (n,) of values at the instants: the mean over each exposure, by Gauss and Legendre."""
        if self.places.ndim == 1:
            return values[self.places]
        return values[self.places] @ (0.5 * np.polynomial.legendre.leggauss(_INSTANTS)[1])


def exposed(time_s: Array, exposure_s: float = 0.0, others_s: tuple[Array, ...] = ()) -> Exposed:
    """Return the instants at which a plant is read so that readings around `time_s` follow, others among them."""
    nodes = time_s
    if exposure_s > 0.0:
        nodes = time_s[:, None] + 0.5 * exposure_s * np.polynomial.legendre.leggauss(_INSTANTS)[0]
    instants = np.unique(np.concatenate([nodes.ravel(), *others_s]))
    return Exposed(instants, np.searchsorted(instants, nodes))
