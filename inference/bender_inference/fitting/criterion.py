"""When one hypothesis beats another: an information criterion that knows how many samples really count.

    C = n_eff ln(S / n) + k ln(n_eff) n_eff / (n_eff - k - 2),      n_eff = n / (1 + 2 sum rho_j)

What a hypothesis leaves is noise and the inadequacy of its forms (Kennedy and O'Hagan 2001). Both are taken as one
process whose variance is profiled out, which gives the first term, and whose correlation is read off the residual of
the better hypothesis: S is the sum of squares of the innovations, over the rows that fits and choices see, of either
residual through the filter of that one (`whitening`), and n_eff allows for what correlation the innovations keep. The
second term is Schwarz's, with the correction for few samples (McQuarrie and Tsai 1998, Regression and Time Series
Model Selection, section 2.3). k are the free numbers, rho_j the autocorrelation up to its first zero.

A difference is weighed at one family-wise error rate a = 1 - confidence. Of m starts on noise alone the luckiest lowers
twice the negative log-likelihood by no more than q + 2 sqrt(q L) + 2 L, L = ln(m / a), with probability 1 - a, q being
the numbers added (Laurent and Massart 2000, lemma 1). Schwarz's price covers the first two terms on records of a few
hundred samples and more; the third is the threshold.
"""

import math
from dataclasses import dataclass

import numpy as np

from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.output_error import Fitted
from bender_inference.fitting.whitening import Whitening, whitening
from bender_inference.records.observations import Array, Mask

CONFIDENCE = 0.99


def very_strong(confidence: float = CONFIDENCE) -> float:
    """Return the difference of the criterion between two given hypotheses that decides: odds of 1 to 1 - confidence.

    At the usual confidence 9.2; Kass and Raftery (1995) call 10 very strong.
    """
    return -2.0 * math.log(1.0 - confidence)


@dataclass(frozen=True, slots=True)
class Yardstick:
    """What differences are weighed with.

    Attributes:
        rows: that fits and choices see.
        effective_rows: as many independent ones say as much.
        tried: starts, among which the luckiest was picked.
        confidence: that no noise is taken for an effect.
        filters: of every record, through which residuals are compared; none where they are as they stand.
    """

    rows: int
    effective_rows: float
    tried: int = 300
    confidence: float = CONFIDENCE
    filters: tuple[Whitening, ...] = ()

    @property
    def threshold(self) -> float:
        """The least difference of the criterion that an added effect must show."""
        return 2.0 * math.log(max(self.tried, 1)) + very_strong(self.confidence)


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


def independent_rows(problem: FitProblem, fitted: Fitted) -> float:
    """Return as how many independent rows the residual of a hypothesis counts, as it stands."""
    rows = zip(fitted.residuals, problem.observations, strict=True)
    return sum(float(x.searched.sum()) / autocorrelation_time(residual, x.searched) for residual, x in rows)


def yardstick(problem: FitProblem, fitted: Fitted, tried: int, confidence: float = CONFIDENCE) -> Yardstick:
    """Return the yardstick that the residual of the better hypothesis gives."""
    filters, rows, effective = [], 0, 0.0
    for residual, x in zip(fitted.residuals, problem.observations, strict=True):
        filters.append(whitening(residual, x.searched))
        innovations = filters[-1].innovations(residual)
        rows += innovations.size
        effective += innovations.size / autocorrelation_time(innovations, np.ones(innovations.size, dtype=np.bool_))
    return Yardstick(rows, effective, tried, confidence, tuple(filters))


def innovations_square(fitted: Fitted, by: Yardstick) -> float:
    """Return the sum of squares of a residual's innovations, through the filters of the better hypothesis."""
    if not by.filters:
        return fitted.training_square + fitted.held_square
    rows = zip(by.filters, fitted.residuals, strict=True)
    return sum(float(np.sum(one.innovations(residual) ** 2)) for one, residual in rows)


def cost(fitted: Fitted, by: Yardstick) -> float:
    """Return the criterion C; lower is better."""
    square = max(innovations_square(fitted, by), 1e-300)
    return by.effective_rows * math.log(square / by.rows) + price(fitted.hypothesis.free_count, by.effective_rows)


def price(count: int, samples: float) -> float:
    """Return what so many free numbers cost with so many independent samples; inf where there are too few of these."""
    left = samples - count - 2.0
    return count * math.log(samples) * samples / left if left > 0.0 else math.inf
