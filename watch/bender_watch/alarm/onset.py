"""Since when, how large, and whether it grows: the profile of the likelihood over the row of the change.

With the change at row t, the whitened residual is e_k = c z_k from t on; its log-likelihood ratio, the best c taken, is
(sum z e)^2 / (2 sum z^2). A ramp has (k - t) z_k in the place of z_k. The rows whose ratio lies within d of the largest
are a confidence set: on either side the ratio falls like a random walk with negative drift, whose largest rise is below
d with probability 1 - exp(-d) at least (Siegmund, International Statistical Review 56, 1988), so both are with
(1 - exp(-d))^2.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_watch.sequential.detector import CLIP, QUIET_CLIP

Array = NDArray[np.float64]

LEVEL = 0.95
WITHIN = -math.log(1.0 - math.sqrt(LEVEL))
"""d of a 95 % confidence set."""
GROWS = 2.5
"""Deviations of a growth that is one."""
RAMP_GAIN = 4.0
"""Log-likelihood by which a ramp has to do better than a step: about the price of one more number."""
FEWEST = 3


@dataclass(frozen=True, slots=True)
class Onset:
    """A change along one signature.

    Attributes:
        place: of the likeliest row, in the rows that were looked at.
        low, high: of the rows of a 95 % confidence set.
        log_likelihood: of the change against none.
        amplitude: of the signature over the rows since, in its unit; of a ramp, at the last row.
        std: of it.
        ramp: it grows from the row of the change on.
        growth_per_row: of the amplitude, a straight line through the rows since.
        growth_std: of it.
    """

    place: int
    low: int
    high: int
    log_likelihood: float
    amplitude: float
    std: float
    ramp: bool
    growth_per_row: float
    growth_std: float

    @property
    def grows(self) -> bool:
        """Whether the amplitude has moved away from zero while it was seen."""
        away = self.growth_per_row * math.copysign(1.0, self.amplitude)
        return self.ramp or away > GROWS * self.growth_std


def onset_of(innovations: Array, whitened: Array, clip: float = CLIP) -> Onset:
    """Return when a change along a signature began.

    Args:
        innovations: (n,) of the rows that count.
        whitened: (n,) signature.
        clip: of the innovations; what is far larger than the noise keeps its shape under a wider one.
    """
    e, z = np.clip(innovations, -clip, clip), whitened
    score, information = _from_the_end(z * e), _from_the_end(z * z)
    step = _ratio(score, information)
    # a ramp from row t: sums of (k - t) z e and (k - t)^2 z^2, by sums of k z e, k z^2 and k^2 z^2
    k = np.arange(e.size, dtype=np.float64)
    first, second = _from_the_end(k * z * e) - k * score, _from_the_end(k * z * z)
    square = _from_the_end(k * k * z * z) - 2.0 * k * second + k * k * information
    ramp = _ratio(first, square)
    is_ramp = bool(np.max(ramp) > np.max(step) + RAMP_GAIN)
    profile = ramp if is_ramp else step
    place = int(np.argmax(profile))
    within = np.flatnonzero(profile >= profile[place] - WITHIN)
    if is_ramp:
        size = float(e.size - 1 - place)
        slope, slope_std = _estimate(float(first[place]), float(square[place]))
        amplitude, std = slope * size, slope_std * size
    else:
        amplitude, std = _estimate(float(score[place]), float(information[place]))
    growth, growth_std = _growth(e[place:], z[place:])
    low, high = int(within[0]), int(within[-1])
    return Onset(place, low, high, float(profile[place]), amplitude, std, is_ramp, growth, growth_std)


def wide_clip(innovations: Array) -> float:
    """Return a clip that keeps the shape of a change that is larger than the noise, and no single row beyond it."""
    return CLIP * max(1.0, 1.4826 * float(np.median(np.abs(innovations)))) if innovations.size else CLIP


def onset_of_variance(innovations: Array, louder: bool) -> Onset:
    """Return when the variance of the innovations (n,) changed; the amplitude is its ratio less one."""
    limit = QUIET_CLIP if louder else CLIP
    square = np.clip(innovations, -limit, limit) ** 2
    counts = np.arange(square.size, 0, -1, dtype=np.float64)
    ratio = np.maximum(_from_the_end(square) / counts, 1e-6)
    likelihood = np.where((ratio > 1.0) == louder, 0.5 * counts * (ratio - 1.0 - np.log(ratio)), 0.0)
    likelihood[-FEWEST:] = 0.0
    place = int(np.argmax(likelihood))
    within = np.flatnonzero(likelihood >= likelihood[place] - WITHIN)
    own = float(ratio[place])
    std = own * math.sqrt(2.0 / float(counts[place]))
    growth, growth_std = _growth(square[place:] - 1.0, np.ones(square.size - place))
    return Onset(
        place,
        int(within[0]),
        int(within[-1]),
        float(likelihood[place]),
        own - 1.0,
        std,
        False,
        growth,
        2.0 * growth_std,
    )


def _from_the_end(values: Array) -> Array:
    return np.cumsum(values[::-1])[::-1]


def _ratio(score: Array, information: Array) -> Array:
    seen = information > 1e-12
    found = np.where(seen, score**2 / (2.0 * np.where(seen, information, 1.0)), 0.0)
    found[-(FEWEST - 1) :] = 0.0
    return found


def _estimate(score: float, information: float) -> tuple[float, float]:
    return (score / information, 1.0 / math.sqrt(information)) if information > 1e-12 else (0.0, math.inf)


def _growth(e: Array, z: Array) -> tuple[float, float]:
    """Return slope per row and its deviation of an amplitude that is a straight line over rows (n,)."""
    k = np.arange(e.size, dtype=np.float64) - 0.5 * (e.size - 1)
    columns = np.column_stack([z, k * z])
    normal = columns.T @ columns
    if e.size < FEWEST or np.linalg.cond(normal) > 1e14:
        return 0.0, math.inf
    inverse = np.linalg.inv(normal)
    return float((inverse @ columns.T @ e)[1]), math.sqrt(max(float(inverse[1, 1]), 0.0))
