"""The steps of the sensor: read off the record, put into the model only where that brings the simulation nearer."""

import math
from dataclasses import dataclass

import numpy as np

from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.records.lattice import coherence, lattice_step_um
from bender_discrepancy.records.observations import Array, Mask
from bender_discrepancy.search.result import SearchResult

QUANTISER = "sensor_quantisation"
# of what the unrounded simulation leaves on held-out rows, rounding it must remove this part
WORTH_ROUNDING = 0.02
# of a noise that is that of rounding and little else
MOST_OF_THE_NOISE = 0.9


@dataclass(frozen=True, slots=True)
class Lattice:
    """Readings that are multiples of one step.

    Attributes:
        step_um: the step.
        coherence: how well their phases on it agree, 1 is perfect.
        share_of_gap: part of the recalibrated residual's variance above the noise that rounding removes.
        before_um: rms on reported rows with a simulation that is not rounded.
        after_um: the same, rounded.
        is_worth_it: whether the steps belong into the model, by the rows that choices are made on.
    """

    step_um: float
    coherence: float
    share_of_gap: float
    before_um: float
    after_um: float
    is_worth_it: bool


def lattice(search: SearchResult) -> Lattice | None:
    """Return the lattice of the readings; None where there is none, or the model as given has it already."""
    step = search.sensor_step_um or _step_in_motion_um(search)
    if step == 0.0 or search.base.values().get(f"{QUANTISER}.step", 0.0) > 0.0:
        return None
    smooth = _readings(search, search.best)
    observations = search.bench.observations
    rounded = [x.rounded_um(y, step) for x, y in zip(observations, smooth, strict=True)]
    chosen_on, reported = [x.judging for x in observations], [x.reporting for x in observations]
    is_worth_it = _square(search, rounded, chosen_on) < (1.0 - WORTH_ROUNDING) * _square(search, smooth, chosen_on)
    before, after = _square(search, smooth, reported), _square(search, rounded, reported)
    above = _square(search, _readings(search, search.found.base), reported) - search.found.noise_um**2
    share = min(max((before - after) / above, 0.0), 1.0) if above > 0.0 else 0.0
    x = observations[0]
    agreed = coherence(x.read_um[x.usable], step)
    return Lattice(step, agreed, share, before**0.5, after**0.5, is_worth_it)


def _step_in_motion_um(search: SearchResult) -> float:
    """Return the step of readings that never stand still, 0 where it is not most of the noise that is left."""
    steps = {lattice_step_um(x.read_um[x.usable]) for x in search.bench.observations}
    step = max(steps)
    return step if len(steps) == 1 and step / math.sqrt(12.0) > MOST_OF_THE_NOISE * search.found.noise_um else 0.0


def _readings(search: SearchResult, fitted: Fitted) -> list[Array]:
    found = search.bench.readings(fitted.hypothesis) or []
    gain, offsets = fitted.calibration.gain, fitted.calibration.offsets_um
    return [gain * y + offset for y, offset in zip(found, offsets, strict=True)]


def _square(search: SearchResult, simulated: list[Array], counted: list[Mask]) -> float:
    """Return the mean square of measured minus simulated on the rows that count."""
    rows = zip(search.bench.observations, simulated, counted, strict=True)
    return float(np.mean(np.concatenate([(x.measured_um - y)[mask] for x, y, mask in rows]) ** 2))
