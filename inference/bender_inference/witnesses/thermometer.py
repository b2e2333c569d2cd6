"""The course of the temperature in a record, and how far the tip may have moved with it.

A film of PVDF on polyimide is a thermometer: its tip moves by some 20 to 50 um for a kelvin. So a temperature that
changes one way must show as a drift of that course, and one that stays leaves a drift only what its noise hides.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bender_inference.fitting.criterion import autocorrelation_time, very_strong
from bender_loop.records.record import Record

Array = NDArray[np.float64]

FEWEST_ROWS = 30
MOST_UM_PER_K = 100.0
"""Twice what is known of films of PVDF on polyimide."""
WARM_K = 0.05
"""A temperature that stays within this moves nothing of another device by what its sensor sees, as far as is known."""
SLOWEST = 1.0
"""Of the time constant of a drift at an even temperature, in durations of the record: nearly a straight line."""
STARTS = ((0.05, 1.0), (0.15, 1.0), (0.5, 1.0), (1.0, 1.0), (3.0, 1.0), (0.3, 2.0), (0.3, 0.5))
BOX = ((1.0 / 30.0, 0.3), (100.0, 4.0))
"""Time constants, in durations of the record, and exponents of a course."""


@dataclass(frozen=True, slots=True)
class Course:
    """What a temperature does over a record.

    Attributes:
        change_K: from the beginning to the end, along the course; 0 where none shows.
        tau_s: time constant of the course.
        exponent: of its stretching.
        most_K: that it may have changed by at most.
        range_K: between the lowest and the highest reading.
    """

    change_K: float
    tau_s: float
    exponent: float
    most_K: float
    range_K: float

    @property
    def is_shown(self) -> bool:
        """Whether the temperature changed."""
        return self.change_K != 0.0


def course_of(record: Record, confidence: float) -> Course | None:
    """Return the course of the temperature of a record; None where it has too few readings of it."""
    if record.temperature_C is None:
        return None
    known = np.isfinite(record.temperature_C)
    if int(known.sum()) < FEWEST_ROWS:
        return None
    read_C = record.temperature_C[known]
    time_s = record.time_s[known] - record.time_s[0]
    duration_s = float(record.time_s[-1] - record.time_s[0])
    range_K = float(np.ptp(read_C))
    if range_K == 0.0:
        return Course(0.0, duration_s, 1.0, 0.0, 0.0)
    fits = [_fitted(time_s / duration_s, read_C, np.array(x)) for x in STARTS]
    place, left = min(fits, key=lambda x: float(x[1] @ x[1]))
    level = read_C - read_C.mean()
    samples = read_C.size / autocorrelation_time(left, np.ones(read_C.size, dtype=np.bool_))
    # three numbers, from several starts
    gained = samples * math.log(float(level @ level) / max(float(left @ left), 1e-300)) - 3.0 * math.log(samples)
    shape = _shape(time_s / duration_s, place)
    weight = float(np.polyfit(shape, read_C, 1)[0])
    change_K = weight * float(np.ptp(shape))
    deviation = math.sqrt(float(left @ left) / read_C.size / samples) / max(float(np.std(shape)), 1e-9)
    most_K = abs(change_K) + math.sqrt(very_strong(confidence)) * deviation * float(np.ptp(shape))
    if gained <= 2.0 * math.log(len(STARTS)) + very_strong(confidence):
        return Course(0.0, duration_s, 1.0, most_K, range_K)
    tau, exponent = float(np.exp(place[0])), float(np.exp(place[1]))
    return Course(change_K, tau * duration_s, exponent, most_K, range_K)


def _shape(at: Array, place: Array) -> Array:
    return -np.expm1(-np.power(at / np.exp(place[0]), np.exp(place[1])))


def _fitted(at: Array, read_C: Array, start: Array) -> tuple[Array, Array]:
    """Return the place in the box, as logarithms, where a course leaves least, and what it leaves."""

    def left(place: Array) -> Array:
        shape = _shape(at, place)
        shape = shape - shape.mean()
        power = float(shape @ shape)
        level = read_C - read_C.mean()
        return level - shape * (float(shape @ level) / power if power > 0.0 else 0.0)

    found = least_squares(left, np.log(start), bounds=(np.log(BOX[0]), np.log(BOX[1])), max_nfev=60)
    return found.x, found.fun
