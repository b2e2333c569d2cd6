"""Slow changes: level and gain by stretches of time, and when they leave what is allowed.

Over each stretch the whitened residual gives amplitude and deviation of level and gain together (least squares). What
scatters more than noise allows widens every interval by the same factor. Neighbouring stretches are put together where
there are too many, so that the whole history is kept in memory that does not grow. Behind a change that stands the line
goes on from another level: what jumps once does not move.

The forecast is a straight line whose slope wanders: an integrated Wiener process beside it (Wahba, JRSS B 40, 1978).
How far it wanders is weighed by the likelihood of the stretches, so that what bends is not told as a straight line, and
what has been straight for long is.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.special import stdtr, stdtrit
from threadpoolctl import threadpool_limits

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

OF = ("gain", "offset")
MOST_STRETCHES = 128
FEWEST_STRETCHES = 8
ROWS_OF_A_STRETCH = 256
MOST_BREAKS = 16
SIGNIFICANT = 0.99
WANDERS = (0.0, 0.125, 0.25, 0.5, 1.0, 2.0)
"""By how much of itself the slope may change over the history, one deviation; taken as equally likely beforehand."""
AHEAD = np.concatenate([[0.0], np.geomspace(1e-3, 1e3, 240)])
"""Times at which the forecast is looked at, in lengths of the history."""


@dataclass(frozen=True, slots=True)
class Trend:
    """A line through what a number was.

    Attributes:
        name: "gain" or "offset".
        now: its value at the last stretch: gain relative to the first baseline, offset in um.
        per_s: slope of the straight line.
        per_s_std: its deviation.
        significant: the slope is not nought, at the level that was asked for.
        leaves_in_s: from now until it leaves what is allowed, as likely sooner as later; None where it does not.
        leaves_low_s, leaves_high_s: 95 % interval of it; `leaves_high_s` None for never.
    """

    name: str
    now: float
    per_s: float
    per_s_std: float
    significant: bool
    leaves_in_s: float | None = None
    leaves_low_s: float | None = None
    leaves_high_s: float | None = None

    def to_event(self) -> dict[str, Any]:
        """Return what stands in the line of events."""
        numbers = {x: getattr(self, x) for x in self.__dataclass_fields__ if x != "name"}
        return {"event": "trend", "of": self.name, **numbers}


@dataclass(slots=True)
class Trends:
    """The stretches so far.

    Attributes:
        sums: (n, 7) of stretches: rows, times, z0 z0, z0 z1, z1 z1, z0 e, z1 e.
        size: rows of a stretch.
        breaks: rows behind which gain and offset are others at once.
    """

    sums: Array = field(default_factory=lambda: np.zeros((0, 7)))
    size: int = ROWS_OF_A_STRETCH
    breaks: list[int] = field(default_factory=list[int])

    def add(self, time_s: Array, innovations: Array, level: Array, gain: Array) -> None:
        """Add judged rows (n,): innovations, and what 1 um of offset and a gain of 1 would add to them."""
        if not time_s.size:
            return
        columns = np.column_stack(
            [np.ones_like(time_s), time_s, level**2, level * gain, gain**2, level * innovations, gain * innovations]
        )
        begin = 0
        while begin < len(columns):
            if not len(self.sums) or self.sums[-1, 0] >= self.size:
                self.sums = np.concatenate([self.sums, np.zeros((1, 7))])
            room = int(self.size - self.sums[-1, 0])
            part = columns[begin : begin + room]
            # one row after the other, so that the sums are the same to the last digit however rows arrive
            self.sums[-1] = np.add.accumulate(np.vstack([self.sums[-1], part]), axis=0)[-1]
            begin += len(part)
            if len(self.sums) > MOST_STRETCHES:
                self._put_together()

    def split(self, before: int) -> None:
        """Begin the lines anew at a change that stands: a step is no slope.

        Args:
            before: rows that have been added since the change.
        """
        self.breaks = [*self.breaks, max(int(self.sums[:, 0].sum()) - before, 0)][-MOST_BREAKS:]

    def _parts(self) -> tuple[NDArray[np.int64], Mask]:
        """Return between which breaks each stretch lies (n,), and which stretches a break goes through."""
        ends = np.cumsum(self.sums[:, 0])
        begins = ends - self.sums[:, 0]
        part = np.searchsorted(self.breaks, begins, side="right")
        return part, part != np.searchsorted(self.breaks, ends, side="left")

    def _put_together(self) -> None:
        pairs = self.sums[: len(self.sums) // 2 * 2].reshape(-1, 2, 7)
        self.sums = np.concatenate([pairs.sum(axis=1), self.sums[len(pairs) * 2 :]])
        self.size *= 2

    def estimates(self) -> tuple[Array, Array, Array, NDArray[np.int64]]:
        """Return times (n,), amplitudes (n, 2) of level and gain, their deviations, and parts between breaks (n,)."""
        rows, time, a, b, c, d, e = self.sums.T
        part, broken = self._parts()
        determinant = a * c - b * b
        kept = ~broken & (determinant > 1e-9 * np.maximum(a * c, 1e-300))
        rows, time, a, b, c, d, e, determinant = (x[kept] for x in (rows, time, a, b, c, d, e, determinant))
        values = np.column_stack([c * d - b * e, a * e - b * d]) / determinant[:, None]
        errors = np.sqrt(np.column_stack([c, a]) / determinant[:, None])
        return time / rows, values, errors, np.unique(part[kept], return_inverse=True)[1]

    def trends(
        self, tolerance: float, stroke_um: float, significance: float = SIGNIFICANT, names: Sequence[str] = OF
    ) -> list[Trend]:
        """Return the trends of gain and offset.

        Args:
            tolerance: what is allowed of the stroke, as a part of it.
            stroke_um: peak to peak.
            significance: of a slope that is one.
            names: of those that are looked at.
        """
        times, values, errors, parts = self.estimates()
        if times.size < FEWEST_STRETCHES + (int(parts[-1]) if parts.size else 0):
            return []
        at = np.eye(int(parts[-1]) + 1)[parts]
        limits = {"gain": (1, tolerance), "offset": (0, tolerance * stroke_um)}
        return [
            _trend(name, times, at, values[:, k], errors[:, k], limit, significance)
            for name, (k, limit) in limits.items()
            if name in names
        ]

    def state(self) -> dict[str, Any]:
        """Return what is remembered."""
        return {"sums": self.sums.tolist(), "size": self.size, "breaks": self.breaks}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        self.sums, self.size = np.array(state["sums"]).reshape(-1, 7), int(state["size"])
        self.breaks = list(state["breaks"])


def _trend(
    name: str, times: Array, at: Array, values: Array, errors: Array, limit: float, significance: float
) -> Trend:
    end, span = float(times[-1]), float(times[-1] - times[0])
    x = (times - end) / span
    # of all parts between breaks one slope, of each its own level; the last ones are those of now
    columns = np.column_stack([at, x])
    free = times.size - columns.shape[1]
    covariance: Array = np.linalg.inv(columns.T @ (columns / errors[:, None] ** 2)).astype(np.float64)
    line = covariance @ columns.T @ (values / errors**2)
    now, slope = line[-2:]
    scatter = float(np.sum(((values - columns @ line) / errors) ** 2)) / free
    std = math.sqrt(max(1.0, scatter) * covariance[-1, -1])
    if abs(slope) <= float(stdtrit(free, 0.5 + 0.5 * significance)) * std:
        return Trend(name, float(now), float(slope / span), std / span, False)
    # of small matrices: threads that wait for a core take many times as long as the work
    with threadpool_limits(limits=1):
        forecasts = [_wandering(x, columns, values, errors, wander * slope) for wander in WANDERS]
    weights = np.exp(np.array([y.log_likelihood for y in forecasts]) - max(y.log_likelihood for y in forecasts))
    weights /= weights.sum()
    side = math.copysign(1.0, slope)
    beyond = [stdtr(free, (side * y.mean - limit) / y.std) for y in forecasts]
    probability = np.asarray(weights @ np.array(beyond))
    low, likely, high = (_first_beyond(probability, part, span) for part in (0.025, 0.5, 0.975))
    level = float(weights @ np.array([y.mean[0] for y in forecasts]))
    return Trend(name, level, float(slope / span), std / span, True, likely, low, high)


@dataclass(frozen=True, slots=True, eq=False)
class _Forecast:
    """Mean and deviation at `AHEAD`, and how likely that makes what was seen."""

    mean: Array
    std: Array
    log_likelihood: float


def _wandering(x: Array, own: Array, values: Array, errors: Array, wander: float) -> _Forecast:
    """Return the forecast of a line whose slope wanders by one deviation over the history.

    Universal kriging and the restricted likelihood (Stein 1999, Interpolation of Spatial Data, section 6.4).

    Args:
        x: (n,) times, from -1 to 0 at the last one.
        own: (n, parts + 1) columns of the line: levels between breaks, and x.
        values: (n,)
        errors: (n,) deviations.
        wander: of the slope.
    """
    ahead = np.column_stack([np.zeros((AHEAD.size, own.shape[1] - 2)), np.ones_like(AHEAD), AHEAD])
    within, across = (wander**2 * _integrated_wiener(x + 1.0, y + 1.0) for y in (x, AHEAD))
    factor = cho_factor(within + np.diag(errors**2), lower=True)
    solved = cho_solve(factor, own)
    normal = own.T @ solved
    line = np.linalg.solve(normal, solved.T @ values)
    left = values - own @ line
    weighed = cho_solve(factor, left)
    square, free = float(left @ weighed), values.size - own.shape[1]
    scatter = max(1.0, square / free)
    mean = ahead @ line + across.T @ weighed
    short = ahead - across.T @ solved
    itself = wander**2 * (AHEAD + 1.0) ** 3 / 3.0
    variance = itself - np.sum(across * cho_solve(factor, across), axis=0)
    variance = variance + np.sum(short * np.linalg.solve(normal, short.T).T, axis=1)
    logarithm = 2.0 * float(np.sum(np.log(np.diag(factor[0])))) + float(np.linalg.slogdet(normal)[1])
    likelihood = -0.5 * (logarithm + square / scatter + free * math.log(scatter))
    return _Forecast(mean, np.sqrt(np.maximum(scatter * variance, 1e-300)), likelihood)


def _integrated_wiener(one: Array, other: Array) -> Array:
    """Return the covariance (n, m) of an integrated Wiener process that begins at nought."""
    early, late = np.minimum(one[:, None], other), np.maximum(one[:, None], other)
    return early**2 * (3.0 * late - early) / 6.0


def _first_beyond(probability: Array, part: float, span_s: float) -> float | None:
    """Return when a probability at `AHEAD` reaches a part, None for never."""
    reached = np.flatnonzero(probability >= part)
    if not reached.size:
        return None
    k = int(reached[0])
    if k == 0:
        return 0.0
    share = (part - probability[k - 1]) / (probability[k] - probability[k - 1])
    return span_s * float(AHEAD[k - 1] + share * (AHEAD[k] - AHEAD[k - 1]))
