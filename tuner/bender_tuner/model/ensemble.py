"""The plants that a tuning must hold for: gain factors times frames of latency around the loop of every model.

The gain is varied by a factor on the reading, so that it works for any plant; each factor has its own operating point
and its own linear model, found once. Gains change the controller only, so a search reuses them all.

Beside the nominal model stand its rivals: those that the records of a diagnosis leave open. Nobody knows which of them
the device is, so what has to hold in the nominal case has to hold in theirs.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from bender_loop.control.pid import Limits
from bender_loop.control.plant import Plant
from bender_loop.control.sampling import Sampling
from bender_tuner.model.linear_model import MOST_FRAMES, Linearisation, linearise_at
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.scaled_plant import ScaledPlant

GAIN_FACTORS = (0.7, 1.0, 1.3)
EXTRA_FRAMES = (0, 1)


class Rival(NamedTuple):
    """A plant that the device may be instead of the nominal one, and the name of its model."""

    name: str
    plant: Plant


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """One plant of an ensemble.

    Attributes:
        gain_factor: on the reading of its model.
        latency_frames: of this case.
        plant: the plant with the factor.
        linearisation: of `plant` at the setpoint.
        delayed: its linear model behind the latency.
        rival: name of its model; empty for the nominal one.
    """

    gain_factor: float
    latency_frames: int
    plant: Plant
    linearisation: Linearisation
    delayed: DelayedPlant
    rival: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Ensemble:
    """The nominal case, all cases, and the nominal case of every rival, which are among them."""

    nominal: Case
    cases: tuple[Case, ...]
    rivals: tuple[Case, ...] = ()

    @property
    def expected(self) -> tuple[Case, ...]:
        """What the device may be, as far as is known: the nominal case of every model."""
        return self.nominal, *self.rivals

    def beside(self, rival: "Ensemble") -> "Ensemble":
        """Return the ensemble with the nominal case of a rival in it, and the one with most gain and latency.

        It is there that a loop is nearest to its bounds; what less gain costs is known from the nominal model.
        """
        hardest = max(rival.cases, key=lambda x: (x.gain_factor, x.latency_frames))
        return Ensemble(self.nominal, (*self.cases, rival.nominal, hardest), (*self.rivals, rival.nominal))


def build_ensemble(
    plant: Plant,
    setpoint_um: float,
    sampling: Sampling,
    limits: Limits,
    gain_factors: Sequence[float] = GAIN_FACTORS,
    extra_frames: Sequence[int] = EXTRA_FRAMES,
    most_frames: int = MOST_FRAMES,
    tell: Callable[[int, int, str], None] | None = None,
    rival: str = "",
) -> Ensemble:
    """Every gain factor with every latency; linearised at `setpoint_um`.

    Args:
        plant: the nominal plant; all cases step this one instance.
        setpoint_um: displacement at which the loops are linearised.
        sampling: of the nominal loop.
        limits: of the command.
        gain_factors: with 1 among them.
        extra_frames: added to the latency of `sampling`, with 0 among them.
        most_frames: longest wait for rest; what creeps on after that is slower than the loop.
        tell: is told how many parts of how many of the work are done, and what comes.
        rival: name of the model where it is a rival of the nominal one.

    Raises:
        InputError: the setpoint is out of reach for one of the factors.
        ValueError: the nominal factor or latency is missing.
    """
    if 1.0 not in gain_factors or not all(math.isfinite(factor) and factor > 0.0 for factor in gain_factors):
        raise ValueError(f"gain_factors must be finite numbers > 0 with 1 among them, found {tuple(gain_factors)!r}")
    if 0 not in extra_frames or min(extra_frames) < 0:
        raise ValueError(f"extra_frames must be whole numbers >= 0 with 0 among them, found {tuple(extra_frames)!r}")
    cases = []
    for done, factor in enumerate(gain_factors, start=1):
        if tell is not None:
            tell(done, 1 + len(gain_factors), f"its answer at the set-point, with gain x {factor:g}")
        scaled = plant if factor == 1.0 else ScaledPlant(plant, factor)
        linearisation = linearise_at(scaled, setpoint_um, sampling, limits, most_frames)
        for extra in extra_frames:
            latency = sampling.latency_frames + extra
            delayed = DelayedPlant(linearisation.model, latency)
            cases.append(Case(factor, latency, scaled, linearisation, delayed, rival))
    nominal = next(c for c in cases if c.gain_factor == 1.0 and c.latency_frames == sampling.latency_frames)
    return Ensemble(nominal, tuple(cases))
