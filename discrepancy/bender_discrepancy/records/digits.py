"""The digits of a record that mean something: what a conversion of units does in the last ones must not be seen."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record

DIGITS = 12
"""Of the span of a column; the best instruments resolve eight or nine, a double holds fifteen."""
DIGITS_OF_A_ROW = 9
"""Of the usual time between two rows."""
_EXACT = 2.0**53


def printed(record: Record) -> Record:
    """Return a record with the digits of each column that an instrument could have printed.

    Volts that were written in kV and read in V differ from the volts in their last bit. A quantiser answers to that
    bit where a command lies on the edge of a step, and so does a search for the smallest of many sums.
    """
    columns: dict[str, Any] = {name: _rounded(values, name) for name, values in record.columns().items()}
    return replace(record, **columns)


def _rounded(values: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    """Return a column (n,) rounded to a decimal place; as it is where its doubles have no digits beyond that."""
    seen = values[np.isfinite(values)]
    largest = float(np.max(np.abs(seen), initial=0.0))
    if largest == 0.0:
        return values
    if name in ("time_s", "command_time_s"):
        decimals = DIGITS_OF_A_ROW - math.ceil(math.log10(float(np.median(np.diff(values)))))
    else:
        decimals = DIGITS - math.ceil(math.log10(float(np.ptp(seen)) or largest))
    if decimals > 22 or largest * 10.0**decimals > _EXACT:
        return values
    return np.round(values, decimals)
