"""The part of a residual that its past does not foretell: innovations of an autoregressive process.

    e_k = r_k - sum_j a_j r_(k-j)

The coefficients solve the Yule-Walker equations on the covariances of rows that count, their number is that of
Schwarz's criterion (Brockwell and Davis 1991, Time Series: Theory and Methods, sections 5.2 and 8.2). Two
residuals seen through the filter of the better one are compared under one covariance: what is slow in the better one
weighs little in both, as in generalised least squares.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, solve_toeplitz

from bender_inference.records.noise import interpolated
from bender_inference.records.observations import Array, Mask

# the usual longest order is so many times the decimal logarithm of the rows
ORDER_PER_DECADE = 10.0
# of a reflection: beyond it, gaps in the record have made covariances that no process has
STABLE = 0.9999


@dataclass(frozen=True, slots=True, eq=False)
class Whitening:
    """The filter of one record.

    Attributes:
        coefficients: (p,) a_1 to a_p.
        usable: (n,) rows that count.
    """

    coefficients: Array
    usable: Mask

    def innovations(self, residual: Array) -> Array:
        """Return the innovations of a residual (n,) at the rows that count, but for the first p of the record."""
        values = interpolated(np.nan_to_num(residual), self.usable)
        filtered = np.convolve(np.concatenate([[1.0], -self.coefficients]), values)[: values.size]
        order = self.coefficients.size
        return filtered[order:][self.usable[order:]]

    def counted(self, rows: Mask) -> Mask:
        """Return which innovations belong to some of the rows that count."""
        order = self.coefficients.size
        return rows[order:][self.usable[order:]]


def whitening(residual: Array, usable: Mask) -> Whitening:
    """Return the filter that makes a residual (n,) white, from its rows that count."""
    count = int(usable.sum())
    covariance = _covariances(residual, usable, int(ORDER_PER_DECADE * math.log10(max(count, 2))))
    if covariance[0] <= 0.0:
        return Whitening(np.zeros(0), usable)
    best, least = np.zeros(0), 0.0
    for order in range(1, covariance.size):
        try:
            a = np.asarray(solve_toeplitz(covariance[:order], covariance[1 : order + 1]), dtype=np.float64)
        except LinAlgError:
            break
        variance = covariance[0] - float(a @ covariance[1 : order + 1])
        # the last coefficient is the reflection
        if abs(float(a[-1])) > STABLE or variance <= 0.0:
            break
        found = count * math.log(variance / covariance[0]) + order * math.log(count)
        if found < least:
            best, least = a, found
    return Whitening(best, usable)


def _covariances(residual: Array, usable: Mask, lags: int) -> Array:
    """Return the covariances up to a lag, each over the pairs of rows that both count."""
    values = np.where(usable, np.nan_to_num(residual), 0.0)
    values = np.where(usable, values - values[usable].mean(), 0.0)
    size = 2 * values.size
    pairs = np.fft.irfft(np.abs(np.fft.rfft(usable.astype(np.float64), size)) ** 2)[: lags + 1]
    products = np.fft.irfft(np.abs(np.fft.rfft(values, size)) ** 2)[: lags + 1]
    return np.asarray(products / np.maximum(pairs, 1.0))
