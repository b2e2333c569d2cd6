"""A bound on Ms that a whole population keeps: the units at hand, and those that nobody measured.

Ms of every unit follows from its linear model, so that a candidate costs one product of arrays. The worst of n units is
not the worst of the population: of two halves of a fleet, either one holds the worst unit with the same probability.
So the bound is also put on the one-sided tolerance limit of Ms, below which 99 % of the population lie with a
confidence of 95 % (Hahn and Meeker, Statistical Intervals, 1991, section 4.6: mean + k s of a normal sample, k from the
noncentral t distribution). log(Ms - 1) is taken as normal: Ms has 1 as its lower end, and gains and delays spread by
factors.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bender_loop.control.pid import Gains
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.margins import sensitivity_peak

COVERED_SHARE, CONFIDENCE = 0.99, 0.95
FEWEST_FOR_TOLERANCE = 10
"""Of fewer units neither mean nor spread is known."""
_GRID, _REFINED = 384, 3
_LEAST_EXCESS = 0.05
"""Of Ms over 1: below it a loop is as good as open, and its logarithm would only widen the spread."""
_LARGEST_TURN_RAD = 0.5 * math.pi


class Loops:
    """The loops of many plants at once, each on a thinned frequency grid."""

    def __init__(self, plants: Sequence[DelayedPlant]) -> None:
        """Thin the grids.

        Args:
            plants: of one sampling period.
        """
        self.plants = tuple(plants)
        self._period_s = self.plants[0].model.period_s
        rows = [_thinned(x.omega_rad_per_s) for x in self.plants]
        self._difference = np.array([x.difference[row] for x, row in zip(self.plants, rows, strict=True)])
        self._response = np.array([x.response_um_per_V[row] for x, row in zip(self.plants, rows, strict=True)])
        self._integrating = np.array([x.model.tail_ratio == 1.0 for x in self.plants], dtype=int)

    def peaks(self, gains: Gains) -> NDArray[np.float64]:
        """Return Ms of every loop, (n,), inf where it is unstable; the largest ones exact, the others to a per cent."""
        d, filter_s, period_s = self._difference, gains.filter_time_s, self._period_s
        controller = gains.proportional_V_per_um + gains.derivative_V_s_per_um * d / (filter_s * d + period_s)
        if gains.integral_V_per_um_s > 0.0:
            controller = controller + gains.integral_V_per_um_s * period_s / d
        distance = 1.0 + controller * self._response
        found = 1.0 / np.min(np.abs(distance), axis=1)
        order = self._integrating + int(gains.integral_V_per_um_s > 0.0)
        image = distance * d ** order[:, None]
        turns = np.angle(image[:, 1:] / image[:, :-1])
        told = np.max(np.abs(turns), axis=1) < _LARGEST_TURN_RAD
        found[told & (np.rint(-np.sum(turns, axis=1) / math.pi) != 0)] = math.inf
        stable = np.flatnonzero(told & np.isfinite(found))
        largest = stable[np.argsort(found[stable])[-_REFINED:]]
        for k in {*np.flatnonzero(~told).tolist(), *largest.tolist()}:
            found[k] = sensitivity_peak(gains, self.plants[k])
        return found


def tolerance_limit(peaks: NDArray[np.float64]) -> float:
    """Return the Ms below which 99 % of a population lie with a confidence of 95 %, from that of some units, (n,).

    Of fewer units than `FEWEST_FOR_TOLERANCE`, and where one of them is unstable, it is the largest one.
    """
    if peaks.size < FEWEST_FOR_TOLERANCE or not np.all(np.isfinite(peaks)):
        return float(np.max(peaks))
    excess = np.log(np.maximum(peaks - 1.0, _LEAST_EXCESS))
    limit = float(np.mean(excess) + tolerance_factor(peaks.size) * np.std(excess, ddof=1))
    return max(float(np.max(peaks)), 1.0 + math.exp(limit))


def tolerance_factor(count: int) -> float:
    """Return k of the one-sided tolerance limit mean + k s of a normal sample of `count` values."""
    from scipy.stats import nct, norm

    root = math.sqrt(count)
    return float(nct.ppf(CONFIDENCE, count - 1, norm.ppf(COVERED_SHARE) * root)) / root


def _thinned(omega_rad_per_s: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return indices of a grid, as many for every grid: half spread evenly in frequency, half in its logarithm."""
    wanted = np.concatenate((
        np.linspace(omega_rad_per_s[0], omega_rad_per_s[-1], _GRID),
        np.geomspace(omega_rad_per_s[0], omega_rad_per_s[-1], _GRID),
    ))  # fmt: skip
    return np.minimum(np.searchsorted(omega_rad_per_s, np.sort(wanted)), omega_rad_per_s.size - 1)
