"""Where a device was before the first row of a record: at rest, or somewhere that nobody knows."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bender_watch.baseline.learn import Baseline, acts_late
from bender_watch.follow.rows import Rows

Array = NDArray[np.float64]

NEARER, FAR = 0.5, 6.0
"""By how much the first reading is nearer to rest than to the first command, and how far from that in noise."""
LEFT_BY_A_PAST = 0.3
"""Part of a first reading beyond rest that what came before must be able to add, to be why."""


def reads_rest(base: Baseline, first: Rows) -> bool:
    """Return whether the first reading is that of a device at rest, whose first command acts behind it."""
    if not acts_late(first.time_s, first.command_time_s):
        return False
    readings = (_expected(base, first, rest=x) for x in (True, False))
    at_rest, stood = (abs(float(base.residual_um(first.displacement_um, x)[0])) for x in readings)
    return at_rest < NEARER * stood and stood > FAR * base.noise_um


def moved_before(base: Baseline, first: Rows, drift_um: Callable[[Array], Array]) -> bool:
    """Return whether a record that begins at 0 V reads what only a motion shortly before it can have left.

    Args:
        base: what is normal; its pasts have begun with the record.
        first: row.
        drift_um: what a drift adds to readings of which this is expected (1,).
    """
    expected = _expected(base, first, rest=True)
    left = float(np.max(np.abs(base.beginning.first_um(first.time_s, first.voltage_V, first.command_time_s))))
    off = abs(float((base.residual_um(first.displacement_um, expected) - drift_um(expected))[0]))
    noticed = FAR * base.noise_um
    return left > noticed if np.isnan(off) else off > noticed and left > LEFT_BY_A_PAST * off


def _expected(base: Baseline, first: Rows, *, rest: bool) -> Array:
    """Return what is expected of the first row (1,)."""
    base.expectation.begin(float(first.time_s[0]), float(first.voltage_V[0]), rest=rest)
    return base.expectation.advance(first.time_s, first.voltage_V, first.command_time_s)[0]
