"""Sparse regression as a package gives it by default: second-order differences, STLSQ, nothing refined.

This is how the paper learned its equations, and what the refined ones are held against.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from bender_identify.regression.terms import library
from bender_loop.records.record import Record

Array = NDArray[np.float64]


@threadpool_limits.wrap(limits=1)
def plain_sindy(terms: Sequence[str], records: Sequence[Record]) -> Array:
    """Return the coefficients (number of terms,) of w' = sum c_k term_k, from all rows of the records.

    The threshold and the ridge of STLSQ are PySINDy's defaults; a term below the threshold has the coefficient 0.
    """
    import pysindy

    columns, rates = [], []
    for record in records:
        u, w = record.voltage_V, record.displacement_um
        columns.append(library(terms, w, u, differences(u, record.time_s, order=2)))
        rates.append(differences(w, record.time_s, order=2))
    optimiser = pysindy.STLSQ()
    optimiser.fit(np.concatenate(columns), np.concatenate(rates)[:, None])
    return np.ravel(np.asarray(optimiser.coef_, dtype=np.float64))


def differences(values: Array, time_s: Array, order: int) -> Array:
    """Return PySINDy's finite differences of `values`, both of shape (n,)."""
    import pysindy

    times: Any = time_s
    return np.asarray(pysindy.FiniteDifference(order=order)(values[:, None], times), dtype=np.float64)[:, 0]
