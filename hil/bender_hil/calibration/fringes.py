"""The lines of a ruler as a wave: how often it repeats, and its phase all over the picture.

The phase of the lines' fundamental, found by multiplying with a carrier and low-pass filtering (Takeda, Ina and
Kobayashi, J. Opt. Soc. Am. 72 (1982), 156), uses every pixel of every line, does not mind uneven light, and needs no
decision about where a line begins.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_loop.errors import InputError
from bender_loop.shell.opencv import import_cv2

Values = NDArray[np.float64]

_LEAST_PROMINENCE = 12.0
_FINEST_PITCH_PX, _FEWEST_LINES = 3.0, 8
_LOWPASS_PITCHES, _STEP_PITCHES = 1.5, 3.0
_LEAST_AMPLITUDE = 0.35
_REFINEMENTS = 4


@dataclass(frozen=True, slots=True)
class Fringes:
    """The phase of a picture's lines, at places far enough apart to be independent.

    Attributes:
        x_px, y_px: places, (n,).
        phase_rad: there, wrapped to -pi ... pi, (n,).
        wave_rad_per_px: mean growth of the phase along x and y.
        step_px: distance of neighbouring places, along x and along y.
        smoothing_px: standard deviation of the Gaussian over which the phase is a mean.
        shape: of the picture, height and width.
    """

    x_px: Values
    y_px: Values
    phase_rad: Values
    wave_rad_per_px: tuple[float, float]
    step_px: int
    smoothing_px: float
    shape: tuple[int, int]


def find_fringes(image: NDArray[np.uint8], name: str) -> Fringes:
    """Measure the lines of one picture.

    Args:
        image: (height, width) of a ruler with evenly spaced straight lines.
        name: of the picture, for complaints.

    Raises:
        InputError: there are no evenly spaced lines in it, or they are too fine or too few.
    """
    levels = image.astype(np.float64)
    wave = _strongest_wave(levels, name)
    y, x = np.indices(image.shape, dtype=np.float64)
    flat = _without_light(levels, 2.0 * math.pi / math.hypot(*wave))
    for _ in range(_REFINEMENTS):
        pitch_px = 2.0 * math.pi / math.hypot(*wave)
        signal = _lowpassed(flat * np.exp(-1j * (wave[0] * x + wave[1] * y)), _LOWPASS_PITCHES * pitch_px)
        wave = wave[0] + _mean_growth(signal, axis=1), wave[1] + _mean_growth(signal, axis=0)
    pitch_px = 2.0 * math.pi / math.hypot(*wave)
    _refuse_odd_pitch(pitch_px, image.shape, wave, name)
    smoothing_px = _LOWPASS_PITCHES * pitch_px
    signal = _lowpassed(flat * np.exp(-1j * (wave[0] * x + wave[1] * y)), smoothing_px)
    step, border = max(1, round(_STEP_PITCHES * pitch_px)), math.ceil(2.0 * smoothing_px)
    rows = np.arange(border, image.shape[0] - border, step)
    columns = np.arange(border, image.shape[1] - border, step)
    row, column = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
    there = signal[row, column]
    clear = np.abs(there) > _LEAST_AMPLITUDE * float(np.percentile(np.abs(there), 90))
    row, column, there = row[clear], column[clear], there[clear]
    carried = there * np.exp(1j * (wave[0] * column + wave[1] * row))
    shape = image.shape[0], image.shape[1]
    places = column.astype(np.float64), row.astype(np.float64)
    return Fringes(*places, np.angle(carried), wave, step, smoothing_px, shape)


def _strongest_wave(levels: Values, name: str) -> tuple[float, float]:
    """The wave vector of the spectrum's highest peak, to a bin, rad per px."""
    height, width = levels.shape
    window = np.outer(np.hanning(height), np.hanning(width))
    spectrum = np.abs(np.fft.rfft2((levels - levels.mean()) * window))
    u, v = np.meshgrid(np.fft.rfftfreq(width), np.fft.fftfreq(height))
    frequency = np.hypot(u, v)
    slowest = _FEWEST_LINES / max(height, width)
    spectrum[(frequency < slowest) | (frequency > 0.5)] = 0.0
    peak = int(spectrum.argmax())
    usual = float(np.median(spectrum[spectrum > 0.0])) if spectrum.any() else 0.0
    if usual == 0.0 or spectrum.flat[peak] < _LEAST_PROMINENCE * usual:
        raise InputError(
            f"{name}: found no evenly spaced lines; expected a picture of a stage micrometer in focus,"
            f" at least {_FEWEST_LINES} lines across it"
        )
    return 2.0 * math.pi * float(u.flat[peak]), 2.0 * math.pi * float(v.flat[peak])


def _without_light(levels: Values, pitch_px: float) -> Values:
    """Contrast against the mean around: uneven light removed, in place and in height."""
    cv2 = import_cv2()
    around = cv2.GaussianBlur(levels, (0, 0), 1.5 * pitch_px)
    return levels / np.maximum(around, 1.0) - 1.0


def _lowpassed(signal: NDArray[np.complex128], sigma_px: float) -> NDArray[np.complex128]:
    cv2 = import_cv2()
    real = cv2.GaussianBlur(np.ascontiguousarray(signal.real), (0, 0), sigma_px)
    imaginary = cv2.GaussianBlur(np.ascontiguousarray(signal.imag), (0, 0), sigma_px)
    return real + 1j * imaginary


def _mean_growth(signal: NDArray[np.complex128], axis: int) -> float:
    """Mean growth of the phase per pixel, weighted with the squared amplitude."""
    count = signal.shape[axis]
    ahead, behind = np.take(signal, range(1, count), axis), np.take(signal, range(count - 1), axis)
    return float(np.angle(np.vdot(behind, ahead)))


def _refuse_odd_pitch(pitch_px: float, shape: tuple[int, ...], wave: tuple[float, float], name: str) -> None:
    if pitch_px < _FINEST_PITCH_PX:
        raise InputError(
            f"{name}: found lines {pitch_px:.2f} px apart, expected at least {_FINEST_PITCH_PX:g};"
            " use a coarser ruler or a higher magnification"
        )
    across = (abs(wave[0]) * shape[1] + abs(wave[1]) * shape[0]) / (2.0 * math.pi)
    if across < _FEWEST_LINES:
        raise InputError(
            f"{name}: found {across:.0f} lines across the picture, expected at least {_FEWEST_LINES}; use a finer ruler"
        )
