"""What the command may have been before the first row of a record that starts in the middle of a motion."""

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.compare import recalibrate
from bender_loop.records.record import Record

Array = NDArray[np.float64]

LONGEST_LEAD_ROWS = 20_000
CLEARLY_BETTER = 0.9
FIRST_READINGS = 3


def reflected(time_s: Array, voltage_V: Array) -> tuple[Array, Array]:
    """Return instants before the first row and commands there: v(-t) = 2 v(0) - v(t), within what the record reaches.

    Args:
        time_s: (n,) rows, increasing.
        voltage_V: (n,) commands.

    Returns:
        Two arrays (m,), m = n - 1 but for very long records.
    """
    rows = min(time_s.size - 1, LONGEST_LEAD_ROWS)
    lead_s = 2.0 * time_s[0] - time_s[rows:0:-1]
    lead_V = 2.0 * voltage_V[0] - voltage_V[rows:0:-1]
    return lead_s, np.clip(lead_V, min(0.0, float(voltage_V.min())), max(0.0, float(voltage_V.max())))


def starts_at_rest(voltage_V: Array) -> bool:
    """Return whether a record begins at 0 V and leaves no question."""
    return not voltage_V[:2].any()


def clearly_better(record: Record, one_um: Array, other_um: Array) -> bool:
    """Return whether a simulation that began in one way meets the first rows of a record better than another one.

    Later rows say little: what the model lacks shows there whichever way the motion began.
    """
    return _early_rms(record, one_um) < CLEARLY_BETTER * _early_rms(record, other_um)


def _early_rms(record: Record, simulated_um: Array) -> float:
    """Gap of the recalibrated simulation in the first readings of the record."""
    seen = np.flatnonzero(np.isfinite(record.displacement_um))
    if seen.size == 0:
        return np.inf
    line = recalibrate(record.displacement_um[seen], simulated_um[seen])
    early = seen[:FIRST_READINGS]
    gap_um = record.displacement_um[early] - line.apply(simulated_um[early])
    return float(np.sqrt(np.mean(np.square(gap_um))))
