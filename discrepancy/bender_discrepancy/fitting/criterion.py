"""When one hypothesis beats another: an information criterion that knows how many samples really count.

    C = n_eff ln(S / n) + k ln(n_eff) n_eff / (n_eff - k - 2),      n_eff = n / (1 + 2 sum rho_j)

It is Schwarz's criterion with the correction for few samples (McQuarrie and Tsai 1998, Regression and Time Series
Model Selection, section 2.3). S is the sum of squares over all rows that count, k the free numbers, rho_j the
autocorrelation of the residual of the better hypothesis up to its first zero. A difference is weighed against the
number of starts that were tried (the look elsewhere): trying m starts on noise alone lowers the best of them by about
2 ln m.
"""

import math
from dataclasses import dataclass

import numpy as np

from bender_discrepancy.fitting.hypothesis import Bench
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.records.observations import Array, Mask

# evidence beyond that of the luckiest of many starts: odds of 150 to 1 ("very strong", Kass and Raftery 1995)
VERY_STRONG = 10.0


@dataclass(frozen=True, slots=True)
class Yardstick:
    """What differences are weighed with: rows that count, rows that count independently, starts tried."""

    rows: int
    effective_rows: float
    tried: int = 300

    @property
    def threshold(self) -> float:
        """The least difference of the criterion that an added effect must show."""
        return 2.0 * math.log(max(self.tried, 1)) + VERY_STRONG


def autocorrelation_time(residual: Array, usable: Mask) -> float:
    """Return 1 + 2 sum rho_j up to the first j with rho_j below its noise, at least 1 (in rows)."""
    values = np.where(usable, residual, 0.0)
    values = np.where(usable, values - values[usable].mean(), 0.0)
    count = values.size
    spectrum = np.abs(np.fft.rfft(values, 2 * count)) ** 2
    covariance = np.fft.irfft(spectrum)[:count]
    if covariance[0] <= 0.0:
        return 1.0
    rho = covariance / covariance[0]
    below = np.nonzero(rho < 2.0 / math.sqrt(count))[0]
    end = int(below[0]) if below.size else count
    return max(1.0, 1.0 + 2.0 * float(np.sum(rho[1:end])))


def yardstick(bench: Bench, fitted: Fitted, tried: int) -> Yardstick:
    """Return the yardstick that the residual of the better hypothesis gives."""
    rows, effective = 0, 0.0
    for residual, x in zip(fitted.residuals, bench.observations, strict=True):
        count = int(x.usable.sum())
        rows += count
        effective += count / autocorrelation_time(residual, x.usable)
    return Yardstick(rows, effective, tried)


def cost(fitted: Fitted, by: Yardstick) -> float:
    """Return the criterion C; lower is better."""
    square = max(fitted.training_square + fitted.held_square, 1e-300)
    return by.effective_rows * math.log(square / by.rows) + price(fitted.hypothesis.free_count, by.effective_rows)


def price(count: int, samples: float) -> float:
    """Return what so many free numbers cost with so many independent samples; inf where there are too few of these."""
    left = samples - count - 2.0
    return count * math.log(samples) * samples / left if left > 0.0 else math.inf


def held_gain(before: Fitted, after: Fitted, by: Yardstick) -> float:
    """Return by how much the held-out rows alone favour the second, as a difference of twice the log-likelihood."""
    part = by.effective_rows / 3.0
    return part * math.log(max(before.held_square, 1e-300) / max(after.held_square, 1e-300))
