"""The experiment that is proposed after an ambiguous verdict: the rivals chosen, the bench's limits, the profile."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_inference.experiment.design import Experiment, design
from bender_inference.experiment.profiles import CAMERA_STEP_S, Sine, seen_limits
from bender_inference.fitting.output_error import Fitted
from bender_inference.records.excitation import sine_frequency_Hz
from bender_inference.records.observations import only_one_sine
from bender_inference.search.judgement.rules import above_floor_um2
from bender_inference.search.noise import floor_square_um2
from bender_inference.search.result import SearchResult

PROFILE = "profile.csv"
EXPERIMENT_SEED = 1
# rivals that one experiment is asked to separate; two of three may be the same thing under two names
MOST_SEPARATED = 3


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """The next experiment.

    Attributes:
        why: the reason, a sentence.
        time_s: (n,) rows of the profile.
        voltage_V: (n,) commands, held from row to row.
        tells_apart: whether it would separate the rivals.
    """

    why: str
    time_s: NDArray[np.float64]
    voltage_V: NDArray[np.float64]
    tells_apart: bool

    def to_dict(self) -> dict[str, Any]:
        """Return the entry `next_experiment` of `diagnosis.json`."""
        return {"why": self.why, "profile": PROFILE if self.tells_apart else None, "tells_apart": self.tells_apart}

    def to_csv(self, unit: str = "V") -> str:
        """Return the profile as `bender hil --profile` reads it; other units than V stand in its head."""
        column = "voltage_V" if unit == "V" else f"command [{unit}]"
        rows = zip(self.time_s.tolist(), self.voltage_V.tolist(), strict=True)
        return f"time_s,{column}\n" + "".join(f"{t!r},{v!r}\n" for t, v in rows)


def propose(search: SearchResult, leaders: Sequence[Fitted], tell: Callable[[str], None]) -> Proposal | None:
    """Return the experiment that separates the leading hypotheses; None where there is only one, or none is known.

    Args:
        search: what the search left.
        leaders: hypotheses that the records cannot distinguish, best first.
        tell: is told what is being done.
    """
    if len(leaders) < 2:
        return None
    tell("designing the next experiment")
    best: Experiment | None = None
    noise_um = math.sqrt(floor_square_um2(search.problem, search.archive.noise_um))
    seen = seen_limits([x.voltage_V for x in search.records], search.settings.highest_V)
    limits = replace(seen, slew_V_per_s=search.settings.slew_V_per_s)
    for count in (MOST_SEPARATED, 2):
        rivals = [x.hypothesis for x in leaders[:count]]
        rng = np.random.default_rng(EXPERIMENT_SEED)
        best = design(
            search.problem.base,
            rivals,
            noise_um,
            _step_s(search),
            rng,
            limits,
            _sine(search),
            _unexplained(search),
            _longest_s(search),
        )
        if len(rivals) == 2 or (best is not None and best.contrast > 1.0):
            break
    return None if best is None else Proposal(best.why, best.time_s, best.voltage_V, best.tells_apart)


def _unexplained(search: SearchResult) -> float:
    """Return the part of the gap (rms) that the best hypothesis leaves above the noise, 0 where that is all."""
    if search.verdict.complete or (gap := above_floor_um2(search.archive, search.found.base)) == 0.0:
        return 0.0
    return math.sqrt(above_floor_um2(search.archive, search.best) / gap)


def _sine(search: SearchResult) -> Sine | None:
    """Return the sine that the records were driven with, None where it was anything else."""
    if not only_one_sine(search.problem.observations):
        return None
    x = search.problem.observations[0]
    low, high = float(np.min(x.command_V)), float(np.max(x.command_V))
    return Sine(sine_frequency_Hz(x.time_s, x.command_V), 0.5 * (low + high), 0.5 * (high - low))


def _step_s(search: SearchResult) -> float:
    """Return the time between rows of the next experiment: that of the first record, of a camera where it has none."""
    return CAMERA_STEP_S if search.settings.untimed else float(np.median(np.diff(search.records[0].time_s)))


def _longest_s(search: SearchResult) -> float:
    """Return the length of the longest record, inf where its rows have no times."""
    return math.inf if search.settings.untimed else max(float(np.ptp(x.time_s)) for x in search.records)
