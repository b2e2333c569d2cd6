"""Since when, how large, and whether it grows: the profile of the likelihood over the row of the change.

With the change at row t, the whitened residual is e_k = c z_k from t on; its log-likelihood ratio, the best c taken, is
(sum z e)^2 / (2 sum z^2). A ramp over l rows has min((k - t) / l, 1) z_k in the place of z_k; one that still grows has
an l beyond the last row. The rows whose ratio lies within d of the largest
are a confidence set: on either side the ratio falls like a random walk with negative drift, whose largest rise is below
d with probability 1 - exp(-d) at least (Siegmund, International Statistical Review 56, 1988), so both are with
(1 - exp(-d))^2.
"""

import math
from collections.abc import Sequence
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
"""Log-likelihood by which a ramp has to do better than a step, and one with an end better than one without: about the
price of one more number."""
FEWEST = 3
SHORTEST, LONGER = 8, math.sqrt(2.0)
"""Rows of the shortest ramp, and by how much each longer one is longer."""


@dataclass(frozen=True, slots=True)
class Onset:
    """A change along one signature.

    Attributes:
        place: of the likeliest row, in the rows that were looked at.
        low, high: of the rows of a 95 % confidence set.
        log_likelihood: of the change against none.
        amplitude: of the signature over the rows since, in its unit; of a ramp, at the last row.
        std: of it.
        length: rows over which it comes in; 0 of a step, inf where it still does.
        whole: place from which on all of it is there, the last of a 95 % set; of what still grows, half of it.
        growth_per_row: of the amplitude, a straight line through the rows since all of it is there, or since it began.
        growth_std: of it.
    """

    place: int
    low: int
    high: int
    log_likelihood: float
    amplitude: float
    std: float
    length: float
    whole: int
    growth_per_row: float
    growth_std: float

    @property
    def ramp(self) -> bool:
        """Whether it does not come in at once."""
        return self.length > 0.0

    @property
    def grows(self) -> bool:
        """Whether the amplitude still moves away from zero at the last row."""
        away = self.growth_per_row * math.copysign(1.0, self.amplitude)
        return math.isinf(self.length) or away > GROWS * self.growth_std

    def weights(self, rows: int) -> Array:
        """Return the part of it that is there at each of so many rows (n,)."""
        return _coming_in(rows, self.place, self.length)


def _coming_in(rows: int, place: int, length: float) -> Array:
    since = np.arange(rows) - place
    whole = min(length, max(rows - 1.0 - place, 1.0))
    part = np.clip(since / whole, 0.0, 1.0) if length > 0.0 else since >= 0
    return part.astype(np.float64)


def onset_of(innovations: Array, whitened: Array, clip: float | None = None) -> Onset:
    """Return when a change along a signature began.

    Args:
        innovations: (n,) of the rows that count.
        whitened: (n,) signature.
        clip: of the innovations; what is far larger than the noise keeps its shape under a wider one. None for the
            usual one, under which no ramp ends: there what grows beyond it stands.
    """
    limit = CLIP if clip is None else clip
    e, z = np.clip(innovations, -limit, limit), whitened
    step = _ratio(_from_the_end(z * e), _from_the_end(z * z))
    lengths, ramps = _ramps(e, z)
    shapes = [step[None, :], ramps[-1:], *([] if clip is None else [ramps[:-1]])]
    best = int(np.argmax([np.max(x, initial=0.0) - k * RAMP_GAIN for k, x in enumerate(shapes)]))
    profile = np.max(shapes[best], axis=0)
    place = int(np.argmax(profile))
    length = (0.0, math.inf, float(lengths[int(np.argmax(ramps[:-1, place]))] if lengths.size else 0.0))[best]
    own = z * _coming_in(e.size, place, length)
    amplitude, std = _estimate(float(own @ e), float(own @ own))
    within = np.flatnonzero(profile >= profile[place] - WITHIN)
    low, high, likelihood = int(within[0]), int(within[-1]), float(profile[place])
    begin = place if math.isinf(length) else place + round(length)
    growth = _growth(e[begin:], z[begin:])
    whole = place + (e.size - place) // 2
    if math.isfinite(length):
        ends = [] if clip is None else [(int(x), y) for x, y in zip(lengths, ramps[:-1], strict=True)]
        whole = max(_last_end(likelihood, ends), begin)
    return Onset(place, low, high, likelihood, amplitude, std, length, whole, *growth)


def _last_end(likelihood: float, ramps: Sequence[tuple[int, Array]]) -> int:
    """Return the last row at which a ramp may have ended that is about as likely as the likeliest; 0 where none is."""
    found = ((length, np.flatnonzero(ratio >= likelihood - WITHIN)) for length, ratio in ramps)
    return max((length + int(x[-1]) for length, x in found if x.size), default=0)


def _ramps(e: Array, z: Array) -> tuple[Array, Array]:
    """Return lengths (l,) and the log-likelihood ratio (l + 1, n) of ramps from every row, last of one without an end.

    A ramp over l rows is the one without an end from row t less that from row t + l, over l: so is its sum of z e. Sums
    of (k - t) z^2 and (k - t)^2 z^2 over the rows k from t on are sums of sums.
    """
    rows = e.size
    count = max(0, math.ceil(math.log(max(rows, 1) / SHORTEST) / math.log(LONGER))) if rows > SHORTEST else 0
    lengths = np.unique(np.round(SHORTEST * LONGER ** np.arange(count))).astype(np.float64)
    first = _behind(_from_the_end(z * e))
    one = _from_the_end(z * z)
    two = _behind(one)
    three = _behind(2.0 * two + one)
    ratios = np.zeros((lengths.size + 1, rows))
    for place, length in enumerate(lengths.astype(int).tolist()):
        last = rows - length
        score = (first[:last] - first[length:]) / length
        information = (three[:last] - three[length:] - 2.0 * length * two[length:]) / length**2
        ratios[place, :last] = _ratio(score, information)
    ratios[-1] = _ratio(first, three)
    return lengths, ratios


def wide_clip(innovations: Array, whitened: Array) -> float:
    """Return a clip that keeps the shape of a change that is larger than the noise, and no single row beyond it.

    What is usual is that of the rows that the signature is seen in: a lag shows behind jumps only, and the innovations
    of all other rows are noise, however large it is.

    Args:
        innovations: (n,) since a change.
        whitened: (n,) its signature.
    """
    size = np.abs(innovations)
    order = np.argsort(size)
    weight = np.cumsum(whitened[order] ** 2)
    if not weight.size or weight[-1] <= 0.0:
        return CLIP
    return CLIP * max(1.0, 1.4826 * float(size[order[np.searchsorted(weight, 0.5 * weight[-1])]]))


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
        0.0,
        place,
        growth,
        2.0 * growth_std,
    )


def _from_the_end(values: Array) -> Array:
    return np.cumsum(values[::-1])[::-1]


def _behind(values: Array) -> Array:
    """Return the sums of the values behind each of them."""
    return np.append(_from_the_end(values)[1:], 0.0)


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
