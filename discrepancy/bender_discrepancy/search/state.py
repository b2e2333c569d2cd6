"""What a search found, and how large what it leaves is."""

import math
from dataclasses import dataclass, field

import numpy as np

from bender_discrepancy.fitting.criterion import Yardstick
from bender_discrepancy.fitting.hypothesis import Bench
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.records.noise import noise_floor_um


@dataclass(frozen=True, slots=True, eq=False)
class Ranked:
    """A hypothesis that was tried on top of another, with the criterion's difference to it (negative: better)."""

    fitted: Fitted
    difference: float


@dataclass(slots=True, eq=False)
class Found:
    """What a search found.

    Attributes:
        base: the model as given, recalibrated.
        best: the hypothesis that stands at the end.
        noise_um: noise floor.
        ranking: hypotheses tried at the first step, best first.
        last_ranking: hypotheses tried at the step that decided the last effect, best first.
        steps: the best hypothesis after every step, base first.
        yardstick: what differences were weighed with at the end.
    """

    base: Fitted
    best: Fitted
    noise_um: float
    yardstick: Yardstick
    ranking: list[Ranked] = field(default_factory=list)
    last_ranking: list[Ranked] = field(default_factory=list)
    steps: list[Fitted] = field(default_factory=list)


def rms_um(fitted: Fitted, bench: Bench, held: bool = True) -> float:
    """Return the rms of a hypothesis on the held-out rows, or on those of the fit."""
    rows = sum(int((x.judging if held else x.training).sum()) for x in bench.observations)
    square = fitted.held_square if held else fitted.training_square
    return math.sqrt(square / max(rows, 1))


def noise_of(fitted: Fitted, bench: Bench) -> float:
    """Return the noise floor that a residual shows, the smallest of all records weighed by their rows."""
    squares = [
        (noise_floor_um(np.nan_to_num(r), x.usable) ** 2, int(x.usable.sum()))
        for r, x in zip(fitted.residuals, bench.observations, strict=True)
    ]
    return math.sqrt(sum(s * n for s, n in squares) / sum(n for _, n in squares))
