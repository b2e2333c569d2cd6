"""The digits of a record that mean something: what a conversion of units does in the last ones must not be seen."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record

DIGITS = 12
"""Of the largest value of a column; the best instruments resolve eight or nine, a double holds fifteen."""
_EXACT = 2.0**53


def printed(record: Record) -> Record:
    """Return a record with the digits of each column that an instrument could have printed.

    Volts that were written in kV and read in V differ from the volts in their last bit. A quantiser answers to that
    bit where a command lies on the edge of a step, and so does a search for the smallest of many sums.
    """
    columns: dict[str, Any] = {name: _rounded(values) for name, values in record.columns().items()}
    return replace(record, **columns)


def _rounded(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a column (n,) rounded to a decimal place; as it is where its doubles have no digits beyond that."""
    seen = values[np.isfinite(values)]
    span = float(np.ptp(seen)) if seen.size else 0.0
    largest = float(np.max(np.abs(seen), initial=0.0))
    size = span or largest
    if size == 0.0:
        return values
    decimals = DIGITS - int(np.ceil(np.log10(size)))
    if decimals > 22 or largest * 10.0**decimals > _EXACT:
        return values
    return np.round(values, decimals)
