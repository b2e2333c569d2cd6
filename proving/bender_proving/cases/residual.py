"""What a model leaves of a reading once gain and offset are corrected."""

import numpy as np
from bender_proving.physics.lobatto import Array


def left_over(reading_um: Array, *model_um: Array) -> Array:
    """What the best shares of some readings, and an offset, leave of `reading_um`, shape (n,)."""
    columns = np.column_stack([*model_um, np.ones_like(reading_um)])
    return reading_um - columns @ np.linalg.lstsq(columns, reading_um, rcond=None)[0]


def left_over_um(reading_um: Array, *model_um: Array) -> float:
    """Rms of `left_over`."""
    return float(np.sqrt(np.mean(left_over(reading_um, *model_um) ** 2)))
