"""The steps of the sensor: read off the record, named where they are worth a word beside the noise.

Left unrounded, a simulation that is off by s on average leaves s^2 + q^2 / 12 of readings in steps of q. Rounded, it
leaves whole steps or nothing: s q sqrt(2 / pi) in square, which is more where s is above q / 8, and still what the
readings are: the likelihood of each reading is that of its step, Phi((d + q / 2) / s) - Phi((d - q / 2) / s) with d the
residual. That the readings have steps is certain, whatever their size; as an effect they are named where q / sqrt(12)
is clearly more than half of s, as a calibration must change the readings by half of the noise. The model has them,
beside another effect, where they are most of the residual: s is clearly below q / sqrt(12). Where nothing else is
named, a model with them must not be worse than the one without: noise clearly above q / 8 carries readings over the
edges of steps, which rounding a simulation without noise does not, and the model stays as it is.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import ndtr

from bender_effects.catalogue import READ_OFF
from bender_inference.fitting.blocked import ERRORS
from bender_inference.fitting.criterion import very_strong
from bender_inference.fitting.output_error import Fitted
from bender_inference.records.digits import coherence, lattice_step_um
from bender_inference.records.observations import Array, Mask
from bender_inference.records.roles import BLOCKS, blocks_of
from bender_inference.search.judgement.rules import RULES
from bender_inference.search.result import SearchResult

# a reading that is misread lies anywhere
LEAST_LIKELY = 1e-6
# deviations of the simulation from the readings, in steps
DEVIATIONS = 1e-3, 1e3
# deviations of the simulation in steps: what rounding alone leaves, and up to where rounding brings it nearer
ROUNDED, NEARER = 1.0 / math.sqrt(12.0), 0.125
# steps of records of one sensor, each found in its own readings
SAME = 1e-6
# of a noise that is that of rounding and little else
MOST_OF_THE_NOISE = 0.9


@dataclass(frozen=True, slots=True)
class Lattice:
    """Readings that are multiples of one step.

    Attributes:
        step_um: the step.
        coherence: how well their phases on it agree, 1 is perfect.
        before_um: rms on reported rows with a simulation that is not rounded.
        after_um: the same, rounded.
        is_named: whether all rows but the reported ones say that the steps are worth a word beside the noise.
        is_simulated: whether the corrected model has them: beside an effect they are clearly most of the residual, or
            rounding does not clearly take the simulation away from the readings.
    """

    step_um: float
    coherence: float
    before_um: float
    after_um: float
    is_named: bool
    is_simulated: bool

    @property
    def share_um(self) -> float:
        """The rms that rounding alone leaves."""
        return ROUNDED * self.step_um


def lattice(search: SearchResult) -> Lattice | None:
    """Return the lattice of the readings; None where there is none, or the model as given has it already."""
    step = search.sensor_step_um or step_in_motion_um(search)
    if step == 0.0 or search.base.values().get(f"{READ_OFF}.step", 0.0) > 0.0:
        return None
    smooth = _readings(search, search.best)
    observations = search.problem.observations
    rounded = [x.rounded_um(y, step) for x, y in zip(observations, smooth, strict=True)]
    reported = [x.reporting for x in observations]
    weighed = _weighed(search, smooth, step)
    before, after = _square(search, smooth, reported), _square(search, rounded, reported)
    x = observations[0]
    agreed = coherence(x.read_um[x.usable], step)
    return Lattice(step, agreed, before**0.5, after**0.5, *weighed)


def step_in_motion_um(search: SearchResult) -> float:
    """Return the step of readings that never stand still, 0 where it is not most of the noise that is left."""
    steps = [lattice_step_um(x.read_um[x.usable]) for x in search.problem.observations]
    step, noise_um = max(steps), search.archive.noise_um
    is_common = math.isclose(min(steps), step, rel_tol=SAME)
    return step if is_common and ROUNDED * step > MOST_OF_THE_NOISE * noise_um else 0.0


def support(left_um: Array, step_um: float, below: float) -> Array:
    """Return how much likelier every reading is with a deviation below a limit than with one above it, shape (n,).

    Each side has its likeliest deviation, which is the limit for one of them; logarithms.

    Args:
        left_um: measured minus simulated, unrounded, shape (n,): of readings that are multiples of the step.
        step_um: of the sensor.
        below: the limit, in steps.
    """
    d = left_um / step_um

    def of_steps(s: float) -> Array:
        return np.log(np.maximum(ndtr((0.5 + d) / s) - ndtr((d - 0.5) / s), LEAST_LIKELY))

    best: Any = minimize_scalar(
        lambda x: -float(np.sum(of_steps(math.exp(x)))), bounds=np.log(DEVIATIONS), method="bounded"
    )
    s = math.exp(best.x)
    return of_steps(min(s, below)) - of_steps(max(s, below))


def _weighed(search: SearchResult, smooth: list[Array], step_um: float) -> tuple[bool, bool]:
    """Return whether the steps are named and simulated: what all rows but the reported ones say beyond chance.

    Fitting has no part in it: the step is read off the record, and no number was fitted with it.
    """
    rows = zip(search.problem.observations, smooth, strict=True)
    kept = [(x.measured_um - y, x.searched, blocks_of(x.usable)) for x, y in rows]
    left = np.concatenate([x[mask] for x, mask, _ in kept])
    block = np.concatenate([(k + 1) * BLOCKS + blocks[mask] for k, (_, mask, blocks) in enumerate(kept)])

    def clearly(gains: Array) -> bool:
        by_block = np.array([np.sum(gains[block == k]) for k in np.unique(block)])
        error = float(np.std(by_block, ddof=1)) * math.sqrt(by_block.size) if by_block.size > 1 else math.inf
        total = float(np.sum(by_block))
        return 2.0 * total > very_strong(search.settings.confidence) and total > ERRORS * error

    is_named = clearly(support(left, step_um, ROUNDED / RULES.matters))
    takes_away = clearly(-support(left, step_um, NEARER))
    beside = bool(search.best.hypothesis.parts) and clearly(support(left, step_um, ROUNDED))
    return is_named, is_named and (beside or not takes_away)


def _readings(search: SearchResult, fitted: Fitted) -> list[Array]:
    found = search.problem.readings(fitted.hypothesis) or []
    gain, offsets = fitted.calibration.gain, fitted.calibration.offsets_um
    return [gain * y + offset for y, offset in zip(found, offsets, strict=True)]


def _square(search: SearchResult, simulated: list[Array], counted: list[Mask]) -> float:
    """Return the mean square of measured minus simulated on the rows that count."""
    rows = zip(search.problem.observations, simulated, counted, strict=True)
    return float(np.mean(np.concatenate([(x.measured_um - y)[mask] for x, y, mask in rows]) ** 2))
