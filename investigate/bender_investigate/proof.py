"""Old and new gains on the bench in alternation, and the interval of their difference.

Both follow the same two set-points, one after the other in the order old, new, new, old, … so that a slow drift of the
bench favours neither. What is compared is the integral of time times error, begun anew at every set-point: what the
tuning made small. The differences of the pairs give an interval by Student's t. Only an interval that lies wholly
beyond a difference that matters says that the new gains are better.
"""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from bender_loop.control.references import Profile
from bender_loop.records.record import Record

Array = NDArray[np.float64]
Judgement = Literal["better", "worse", "no difference", "not known"]
LEAD_S = 0.2
"""At 0 µm before the first step."""
HIGH_SHARE, LOW_SHARE = 0.6, 0.25
"""Of the stroke that the bench has shown: the two set-points."""
LEAST_PAIRS = 2
NOISES = 3.0


@dataclass(frozen=True, slots=True)
class Task:
    """Two set-points, up and part of the way down, each held for as long.

    Attributes:
        high_um, low_um: the set-points.
        step_s: how long each is held.
        noise_um: of the bench at rest; an error within three deviations of it costs nothing.
    """

    high_um: float
    low_um: float
    step_s: float
    noise_um: float = 0.0

    @classmethod
    def of_stroke(cls, stroke_um: float, step_s: float, noise_um: float = 0.0) -> "Task":
        """Return the task for a bench with this stroke."""
        return cls(HIGH_SHARE * stroke_um, LOW_SHARE * stroke_um, step_s, noise_um)

    @property
    def starts_s(self) -> tuple[float, float]:
        """When the set-points jump."""
        return LEAD_S, LEAD_S + self.step_s

    @property
    def duration_s(self) -> float:
        """Length of a play."""
        return LEAD_S + 2.0 * self.step_s

    @property
    def reference(self) -> Profile:
        """The set-points over time."""
        return Profile((0.0, *self.starts_s), (0.0, self.high_um, self.low_um))


@dataclass(frozen=True, slots=True)
class Comparison:
    """What the bench says of two sets of gains.

    Attributes:
        judgement: of the new gains.
        old, new: costs of the plays, in µm s², in pairs.
        mean, low, high: of the saving per pair, as a part of the mean old cost, with the ends of its interval.
        confidence: of the interval.
        trips: plays with the old and with the new gains that the guard or the runner had to end.
    """

    judgement: Judgement
    old: tuple[float, ...]
    new: tuple[float, ...]
    mean: float
    low: float
    high: float
    confidence: float
    trips: tuple[int, int] = (0, 0)

    @property
    def sentence(self) -> str:
        """The judgement with its numbers."""
        if any(self.trips):
            ended = f"with the old gains {self.trips[0]} plays had to be ended, with the new ones {self.trips[1]}"
            kept = "the new gains are better on the bench" if self.judgement == "better" else "the old gains stay"
            return f"{kept}: {ended}"
        if self.judgement == "not known":
            return f"{len(self.old)} pairs of plays do not say whether the new gains are better; the old ones stay"
        interval = (
            f"{100 * self.low:+.1f} to {100 * self.high:+.1f} % of the cost, {100 * self.confidence:g} % interval"
        )
        told = {
            "better": "the new gains are better on the bench: they save",
            "worse": "the new gains are worse on the bench, the old ones stay: saved were",
            "no difference": "no difference that matters was shown, the old gains stay: saved were",
        }[self.judgement]
        return f"{told} {100 * self.mean:.1f} % ({interval}, {len(self.old)} pairs)"

    def to_dict(self) -> dict[str, Any]:
        """Return it for a file."""
        return {
            "judgement": self.judgement,
            "sentence": self.sentence,
            "old_cost_um_s2": list(self.old),
            "new_cost_um_s2": list(self.new),
            "ended_plays": {"old": self.trips[0], "new": self.trips[1]},
            "saving": {"mean": self.mean, "low": self.low, "high": self.high, "confidence": self.confidence},
        }


def order(pairs: int) -> list[tuple[int, str]]:
    """Return the plays of an alternation as (pair, "old" or "new"): old first in every other pair."""
    return [(k, x) for k in range(pairs) for x in (("old", "new") if k % 2 == 0 else ("new", "old"))]


def cost_um_s2(time_s: Array, tip_um: Array, task: Task) -> float:
    """Return the integral of time times error, begun anew at every set-point, of the frames that have a tip.

    What the noise alone explains is no error: without that, it would be most of the cost of a good loop.
    """
    seen = np.isfinite(tip_um)
    total = 0.0
    ends = (*task.starts_s[1:], task.duration_s)
    for start_s, end_s, level_um in zip(task.starts_s, ends, (task.high_um, task.low_um), strict=True):
        rows = seen & (time_s >= start_s - 1e-9) & (time_s < end_s - 1e-9)
        since_s = time_s[rows] - start_s
        if since_s.size < 2:
            return math.inf
        error_um = np.maximum(np.abs(level_um - tip_um[rows]) - NOISES * task.noise_um, 0.0)
        total += float(np.trapezoid(since_s * error_um, since_s))
    return total


def cost_of(record: Record, task: Task) -> float:
    """Return the cost of a play; its set-point says when the clock of the task began."""
    setpoint = record.setpoint_um
    if setpoint is None:
        return math.inf
    moved = np.flatnonzero(np.isfinite(setpoint) & (setpoint != 0.0))
    if not moved.size:
        return math.inf
    began_s = float(record.time_s[moved[0]]) - LEAD_S
    return cost_um_s2(record.time_s - began_s, record.displacement_um, task)


def compare_costs(old: ArrayLike, new: ArrayLike, confidence: float = 0.95, least_gain: float = 0.02) -> Comparison:
    """Return what pairs of costs say; plays that had to be ended speak before all costs.

    Args:
        old: costs of the plays with the old gains in µm s², inf for a play that had to be ended.
        new: the same with the new ones, in the order of the pairs.
        confidence: of the interval.
        least_gain: a saving below this part of the mean old cost does not matter.
    """
    a, b = np.asarray(old, dtype=np.float64), np.asarray(new, dtype=np.float64)
    nan = math.nan
    trips = int(np.isinf(a).sum()), int(np.isinf(b).sum())
    if any(trips):
        word: Judgement = "worse" if trips[1] > trips[0] else "not known"
        if trips[0] >= LEAST_PAIRS and not trips[1] and b.size >= LEAST_PAIRS:
            word = "better"
        return Comparison(word, tuple(a.tolist()), tuple(b.tolist()), nan, nan, nan, confidence, trips)
    if a.size < LEAST_PAIRS or not (np.all(np.isfinite(a)) and np.all(np.isfinite(b))) or a.mean() <= 0.0:
        return Comparison("not known", tuple(a.tolist()), tuple(b.tolist()), nan, nan, nan, confidence)
    saved = (a - b) / a.mean()
    mean = float(saved.mean())
    error = float(saved.std(ddof=1)) / math.sqrt(saved.size)
    half = float(stats.t.ppf(0.5 + 0.5 * confidence, saved.size - 1)) * error
    low, high = mean - half, mean + half
    judgement: Judgement = "better" if low > least_gain else "worse" if high < -least_gain else "no difference"
    return Comparison(judgement, tuple(a.tolist()), tuple(b.tolist()), mean, low, high, confidence)
