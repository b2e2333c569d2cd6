"""Evidence in coarse readings: what an effect changes must show in the readings themselves.

A fit to coarse readings counts only how far the simulation lies beyond the step in which the tip must have been. Of
that little is left, and it is no noise: where the tip stands near the edge of a step, the noise of the sensor pushes
readings to the next one, always the same way. So a small effect may seem to explain it. In the readings as they are it
vanishes beside the steps.
"""

import math

import numpy as np

from bender_discrepancy.fitting.criterion import autocorrelation_time, price
from bender_discrepancy.fitting.hypothesis import Bench
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.records.observations import Array


def shows_in_the_readings(bench: Bench, before: Fitted, after: Fitted) -> bool:
    """Return whether the criterion, of readings as they are, favours the second hypothesis as well.

    Readings that are not coarse have been judged as they are: always True.
    """
    if all(x.half_step_um == 0.0 for x in bench.observations):
        return True
    first, second = (_left_um(bench, x) for x in (before, after))
    if first is None or second is None:
        return False
    effective = 0.0
    for left, x in zip(second, bench.observations, strict=True):
        effective += float(x.usable.sum()) / autocorrelation_time(np.nan_to_num(left), x.usable)
    gained = effective * math.log(_square(bench, first) / max(_square(bench, second), 1e-300))
    added = price(after.hypothesis.free_count, effective) - price(before.hypothesis.free_count, effective)
    return gained > added


def _square(bench: Bench, left: list[Array]) -> float:
    return sum(float(np.sum(r[x.usable] ** 2)) for r, x in zip(left, bench.observations, strict=True))


def _left_um(bench: Bench, fitted: Fitted) -> list[Array] | None:
    readings = bench.readings(fitted.hypothesis)
    if readings is None:
        return None
    gain, offsets = fitted.calibration.gain, fitted.calibration.offsets_um
    return [
        x.measured_um - gain * y - offset for x, y, offset in zip(bench.observations, readings, offsets, strict=True)
    ]
