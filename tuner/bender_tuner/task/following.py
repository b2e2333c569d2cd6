"""Model following in a tuning: the shaper and the horizon that suit a model, judged as gains are judged."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from bender_loop.control.metrics import SETTLING_BAND
from bender_loop.control.sampling import Sampling
from bender_loop.control.shaper import rise_in
from bender_loop.fmu.followed_model import FollowedModel

RISE_TICKS = (1, 2, 3, 4, 5, 6, 8, 10)
"""A step of the set-point may take so many samples."""
HORIZON_TICKS, MOST_TICKS = (1, 2), 64
LONGER_RISES = (1, 1.5, 2, 3, 4)
"""The same in horizons, where those are longer."""
_DEVIATIONS = 2.0 * math.sqrt(2.0)
"""Of one value: two that are drawn alike differ by less."""
AS_NEAR = 1.01
"""Up to so many times the least rms a calmer candidate is taken."""
ARRIVED = 0.9
"""Of the settling band, the most that is held back."""
TOLERANCE_SHARE = 1e-4
"""Of the set-point: how near the inverse comes."""


@dataclass(frozen=True, slots=True)
class Following:
    """A model-following controller apart from its gains: what is followed, and the FMU of it."""

    model: FollowedModel
    fmu: Path


def candidates(
    model: FollowedModel, fmu: Path, setpoint_um: float, sampling: Sampling, lag_s: float
) -> Iterator[list[Following]]:
    """Yield shapers with horizons, the shortest horizons first, up to the lag of the plant.

    A plant that is slower than the samples cannot be led from one to the next: the command would swing from bound to
    bound.
    """
    ticks = [(horizon, rise) for horizon in HORIZON_TICKS for rise in RISE_TICKS]
    horizon = HORIZON_TICKS[-1]
    while True:
        yield [_shaped(model, fmu, setpoint_um, rise * sampling.period_s, horizon) for horizon, rise in ticks]
        horizon *= 2
        if horizon > min(MOST_TICKS, lag_s / sampling.period_s):
            return
        ticks = [(horizon, rise * horizon) for rise in LONGER_RISES]


def _shaped(model: FollowedModel, fmu: Path, setpoint_um: float, rise_s: float, horizon: int) -> Following:
    shaper = rise_in(setpoint_um, rise_s)
    tried = replace(
        model,
        rate_um_per_s=shaper.rate_um_per_s,
        curvature_um_per_s2=shaper.curvature_um_per_s2,
        horizon_ticks=horizon,
    )
    return Following(tried, fmu)


def held_back(overshoot: float, bound: float) -> float:
    """Return the part of a movement to leave to the PID block so that an overshoot, as a share, comes to `bound`.

    It is less than what counts as arrived: a device that is as its model settles as soon as if nothing were held back.
    """
    return min(max(1.0 - (1.0 + bound) / (1.0 + overshoot), 0.0), ARRIVED * SETTLING_BAND)


@dataclass(frozen=True, slots=True)
class Scored:
    """One candidate.

    Attributes:
        following: what is tried.
        value: of the objective.
        nominal_rms_um: from the set-point, of the step on the nominal plant.
        bounds_kept: whether it keeps the bounds.
        harm: that it does to a device without what no diagnosis vouches for, in words; it is not kept then either.
    """

    following: Following
    value: float
    nominal_rms_um: float
    bounds_kept: bool
    harm: str = ""


def choose(
    scored: list[Scored],
    plain: float = math.inf,
    spread: Callable[[Following], float] = lambda _: 0.0,
) -> Scored | None:
    """Return the one that is nearest to the set-point of all that are good; None where nothing is.

    Good is what keeps the bounds, is better than the PID block alone, and is as safe as the best: its objective is
    above the least by no more than that of the best differs from itself with another noise of the readings. The cases
    with a wrong gain rule the objective, which no shaper helps; by it alone shapers differ by less than its noise,
    behind a play by far, while a slow one costs a tenth of the rms.

    Of the good ones the quickest on the nominal plant is taken. Where others are as near, the calmest of them is: the
    shortest horizon comes first, for it leaves the least to a command that is held longer than it will be, then the
    slowest shaper.

    A known reference is not shaped and moves between the samples, and a command that is meant to be held over several
    of them is ahead of it: for it the shortest horizon is kept with which any shaper keeps the bounds and is worth
    having.

    Args:
        scored: all that was tried.
        plain: a value that a good one is below: that of the PID block alone.
        spread: says by which part of itself the objective of one candidate is spread over other noises.
    """
    fit = [x for x in scored if x.bounds_kept and not x.harm and math.isfinite(x.value) and x.value < plain]
    if not fit:
        return None
    safest = min(fit, key=lambda x: x.value)
    most = max(AS_NEAR, 1.0 + _DEVIATIONS * spread(safest.following)) * safest.value
    good = [x for x in fit if x.value <= most]
    least_um = min(x.nominal_rms_um for x in good)
    near = [x for x in good if x.nominal_rms_um <= AS_NEAR * least_um]
    best = min(near, key=lambda x: (x.following.model.horizon_ticks, x.following.model.rate_um_per_s))
    known = min(x.following.model.horizon_ticks for x in fit)
    model = replace(best.following.model, preview_horizon_ticks=known)
    return replace(best, following=replace(best.following, model=model))
