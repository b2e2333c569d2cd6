"""How many readings of a correlated residual count as one."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def correlation_rows(residual: Array) -> float:
    """Return 1 + 2 sum of the autocorrelations up to the first that is not positive, at least 1."""
    centred = residual - residual.mean()
    n = len(centred)
    power = float(centred @ centred)
    if power == 0.0 or n < 8:
        return 1.0
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[: n // 4] / power
    ends = np.flatnonzero(correlation <= 0.0)
    return max(1.0, float(2.0 * correlation[: ends[0] if ends.size else None].sum() - 1.0))
