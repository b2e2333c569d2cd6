"""Slow changes: level and gain by stretches of time, a line through them, and when it leaves what is allowed.

Over each stretch the whitened residual gives amplitude and deviation of level and gain together (least squares). What
scatters more than noise allows widens every interval by the same factor. Neighbouring stretches are put together where
there are too many, so that the whole history is kept in memory that does not grow.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

Array = NDArray[np.float64]

MOST_STRETCHES = 128
FEWEST_STRETCHES = 8
ROWS_OF_A_STRETCH = 256
SIGNIFICANT = 0.99


@dataclass(frozen=True, slots=True)
class Trend:
    """A line through what a number was.

    Attributes:
        name: "gain" or "offset".
        now: its value at the last stretch, as the line has it: gain relative to the baseline, offset in um.
        per_s: slope.
        per_s_std: its deviation.
        significant: the slope is not nought, at 99 %.
        leaves_in_s: from now until the line leaves what is allowed; None where it does not.
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


@dataclass(slots=True)
class Trends:
    """The stretches so far.

    Attributes:
        gain_unit: the gain that an amplitude of 1 of its signature is.
        offset_unit_um: the offset that an amplitude of 1 is.
        sums: (n, 7) of stretches: rows, mean time, z0 z0, z0 z1, z1 z1, z0 e, z1 e.
    """

    gain_unit: float
    offset_unit_um: float
    sums: Array = field(default_factory=lambda: np.zeros((0, 7)))
    size: int = ROWS_OF_A_STRETCH

    def add(self, time_s: Array, innovations: Array, level: Array, gain: Array) -> None:
        """Add judged rows (n,): their innovations and the whitened signatures of level and gain."""
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
            last = self.sums[-1].copy()
            rows = last[0] + len(part)
            mean = (last[0] * last[1] + float(part[:, 1].sum())) / rows
            last += part.sum(axis=0)
            last[1] = mean
            self.sums[-1] = last
            begin += len(part)
            if len(self.sums) > MOST_STRETCHES:
                self._put_together()

    def _put_together(self) -> None:
        pairs = self.sums[: len(self.sums) // 2 * 2].reshape(-1, 2, 7)
        joined = pairs.sum(axis=1)
        joined[:, 1] = (pairs[:, :, 0] * pairs[:, :, 1]).sum(axis=1) / joined[:, 0]
        self.sums = np.concatenate([joined, self.sums[len(pairs) * 2 :]])
        self.size *= 2

    def estimates(self) -> tuple[Array, Array, Array]:
        """Return times (n,), amplitudes (n, 2) of level and gain, and their deviations (n, 2)."""
        times, values, errors = [], [], []
        for _, time, a, b, c, d, e in self.sums:
            determinant = a * c - b * b
            if determinant <= 1e-9 * max(a * c, 1e-300):
                continue
            times.append(time)
            values.append(((c * d - b * e) / determinant, (a * e - b * d) / determinant))
            errors.append((math.sqrt(c / determinant), math.sqrt(a / determinant)))
        return np.array(times), np.array(values).reshape(-1, 2), np.array(errors).reshape(-1, 2)

    def trends(self, tolerance: float, stroke_um: float) -> list[Trend]:
        """Return the trends of gain and offset.

        Args:
            tolerance: what is allowed of the stroke, as a part of it.
            stroke_um: peak to peak.
        """
        times, values, errors = self.estimates()
        if times.size < FEWEST_STRETCHES:
            return []
        units = (("offset", self.offset_unit_um, tolerance * stroke_um), ("gain", self.gain_unit, tolerance))
        return [
            _trend(name, times, unit * values[:, k], abs(unit) * errors[:, k], limit)
            for k, (name, unit, limit) in enumerate(units)
        ][::-1]

    def state(self) -> dict[str, Any]:
        """Return what is remembered."""
        return {"sums": self.sums.tolist(), "size": self.size}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        self.sums, self.size = np.array(state["sums"]).reshape(-1, 7), int(state["size"])


def _trend(name: str, times: Array, values: Array, errors: Array, limit: float) -> Trend:
    weights = 1.0 / errors**2
    end = float(times[-1])
    x = times - end
    columns = np.column_stack([np.ones_like(x), x])
    covariance: Array = np.linalg.inv(columns.T @ (weights[:, None] * columns)).astype(np.float64)
    now, slope = covariance @ columns.T @ (weights * values)
    free = times.size - 2
    scatter = float(np.sum(weights * (values - now - slope * x) ** 2)) / free
    covariance *= max(1.0, scatter)
    quantile = float(student.ppf(0.975, free))
    std = math.sqrt(covariance[1, 1])
    significant = abs(slope) > float(student.ppf(0.5 + 0.5 * SIGNIFICANT, free)) * std
    if not significant:
        return Trend(name, float(now), float(slope), std, False)
    crossing = _crossing(float(now), float(slope), math.copysign(limit, slope), covariance, quantile)
    return Trend(name, float(now), float(slope), std, True, *crossing)


def _crossing(
    now: float, slope: float, limit: float, covariance: Array, quantile: float
) -> tuple[float, float, float | None]:
    """Return when now + slope t is at the limit, and the ends of its interval (Fieller 1954), none below 0.

    The ends are the t at which (now + slope t - limit)^2 = quantile^2 times its variance.
    """
    q2 = quantile * quantile
    a = slope * slope - q2 * covariance[1, 1]
    b = slope * (now - limit) - q2 * covariance[0, 1]
    c = (now - limit) ** 2 - q2 * covariance[0, 0]
    likely = max((limit - now) / slope, 0.0)
    root = b * b - a * c
    if root < 0.0:
        return likely, 0.0, None
    ends = sorted(((-b - math.sqrt(root)) / a, (-b + math.sqrt(root)) / a)) if a != 0.0 else [0.0, math.inf]
    if a <= 0.0:
        return likely, max(ends[1], 0.0), None
    return likely, max(ends[0], 0.0), max(ends[1], 0.0)
