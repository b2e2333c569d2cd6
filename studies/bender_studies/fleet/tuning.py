"""One controller for a fleet against one tuned on the nominal model with its gain 30 % up and down."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bender_fleet.tuning.command import judged, tune_fleet
from bender_fleet.tuning.plants import corrected_models
from bender_fleet.tuning.search import quantiles
from bender_tuner.task.settings import make_settings


@dataclass(frozen=True, slots=True)
class Compared:
    """Quantiles over units that no search saw.

    Attributes:
        units: that were tuned on or judged.
        held_out: of these, judged only, and brought to rest by one of the two at least.
        unserved: units of the fleet that no gains bring to rest.
        groups: sets of gains.
        ours: "Ms" and "settling", each with median, q95 and worst, under the gains of the fleet.
        nominal: the same under those of the nominal model.
        at_rest: how many of those held out our gains bring to rest, and how many those of the nominal model.
        both: worst settling time of the units that both bring to rest, under ours and under those of the nominal model.
        keeping: of the units, those that keep the nominal gains.
        own: of the units, those with gains of their own.
    """

    units: int
    held_out: int
    unserved: int
    groups: int
    ours: dict[str, dict[str, float]]
    nominal: dict[str, dict[str, float]]
    at_rest: tuple[int, int]
    both: tuple[float, float]
    keeping: int = 0
    own: int = 0


def compare_tunings(
    fleet: Path, units: int, evaluations: int, groups: int | None, report: Any, seed: int = 0
) -> Compared:
    """Tune on half of the first corrected units, judge on the other half; `seed` draws which half."""
    models = dict(list(corrected_models(fleet).items())[:units])
    settings = make_settings(evaluations=evaluations, duration_s=4.0, seed=seed)
    found = tune_fleet(models, "paper", settings, groups, 0.5, report)
    own, theirs = judged(found)
    ours, nominal = (
        {"Ms": quantiles([x.sensitivity_peak for x in told]), "settling": quantiles([x.settling_s for x in told])}
        for told in (own, theirs)
    )
    resting = [(a.settling_s, b.settling_s) for a, b in zip(own, theirs, strict=True)]
    at_rest = sum(math.isfinite(a) for a, _ in resting), sum(math.isfinite(b) for _, b in resting)
    pairs = [x for x in resting if max(x) < math.inf]
    both = max((a for a, _ in pairs), default=math.inf), max((b for _, b in pairs), default=math.inf)
    unserved = len(models) - len(found.ours)
    kinds = len(found.keeping), len(found.own)
    return Compared(len(found.ours), len(own), unserved, len(found.gains), ours, nominal, at_rest, both, *kinds)
