"""What the judgements come to: shares of right answers beside what is promised, and who was taken for whom."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median

from bender_studies.hidden_effects.judging import MOST_CANDIDATES, Judged

LEFT_OVER_FLOOR = 1.2
CONFIDENCE = 1.96


@dataclass(frozen=True, slots=True)
class Figure:
    """One promise and what came of it.

    Attributes:
        words: what is counted.
        value: the figure; nan where nothing was judged.
        promised: what it should reach.
        count: cases behind it.
        at_most: the promise is an upper bound.
        interval: 95 % interval of a share (Wilson); None for other figures.
    """

    words: str
    value: float
    promised: float
    count: int
    at_most: bool = False
    interval: tuple[float, float] | None = None

    @property
    def is_kept(self) -> bool:
        """Whether the promise is kept."""
        return self.value <= self.promised if self.at_most else self.value >= self.promised


def share(words: str, promised: float, cases: Sequence[Judged], test: Callable[[Judged], bool]) -> Figure:
    """Return the share of cases that pass a test."""
    count = len(cases)
    if not count:
        return Figure(words, math.nan, promised, 0)
    part = sum(test(x) for x in cases) / count
    return Figure(words, part, promised, count, interval=wilson(part, count))


def wilson(part: float, count: int) -> tuple[float, float]:
    """Return the 95 % interval of a share of a number of cases (Wilson 1927)."""
    z2 = CONFIDENCE**2 / count
    middle = (part + 0.5 * z2) / (1.0 + z2)
    half = CONFIDENCE * math.sqrt(part * (1.0 - part) / count + 0.25 * z2 / count) / (1.0 + z2)
    return max(0.0, middle - half), min(1.0, middle + half)


def figures(cases: Sequence[Judged]) -> list[Figure]:
    """Return the figures of clean cases in the order of the promises; kinds that were not judged are left out."""

    def of(kind: str) -> list[Judged]:
        return [x for x in cases if x.kind == kind]

    singles, weak = of("single"), of("weak")
    gaps = [x.of_second_gap for x in singles if math.isfinite(x.of_second_gap)]
    numbers = [x for x in singles if x.numbers_right is not None]
    found = [
        share("single effect: its name alone", 0.97, singles, lambda x: x.is_right),
        share("single effect: at most 1.2 times the floor is left", 0.90, singles, lambda x: _is_little(x)),
        Figure("single effect: gap left on a second record, median", median(gaps), 0.10, len(gaps), at_most=True)
        if gaps
        else Figure("", math.nan, 0.1, 0),
        share("quantiser or surroundings: size within a tenth", 0.90, numbers, lambda x: bool(x.numbers_right)),
        share("nothing hidden: nothing named, nothing called missing", 0.98, of("nothing"), lambda x: x.is_right),
        share("gain or offset off: recalibrated", 0.90, of("calibration"), lambda x: x.is_right),
        share("two effects: both names alone", 0.90, of("pair"), lambda x: x.is_right),
        share("outside the catalogue: unexplained, no name", 0.90, of("outside"), lambda x: x.is_right),
        share(
            f"too weakly excited: ambiguous, the truth among at most {MOST_CANDIDATES}",
            0.90,
            weak,
            lambda x: x.is_right,
        ),
        share("the same after the designed experiment: the right name", 0.90, weak, lambda x: x.is_right_after),
    ]
    return [x for x in found if x.count]


def _is_little(x: Judged) -> bool:
    return x.over_floor <= LEFT_OVER_FLOOR


def confusion(cases: Sequence[Judged]) -> list[tuple[str, str, int]]:
    """Return (hidden, answered, cases), most frequent first within each hidden effect."""
    counted = Counter((" + ".join(sorted(x.truth)) or x.kind, x.said) for x in cases)
    return sorted(((t, s, n) for (t, s), n in counted.items()), key=lambda x: (x[0], -x[2], x[1]))


def false_names(cases: Sequence[Judged]) -> Counter[str]:
    """Return how often each effect was named that was not there."""
    return Counter(name for x in cases if x.is_false_name for name in set(x.answer.named) - set(x.truth))


def candidates_of(cases: Sequence[Judged]) -> tuple[float, int] | None:
    """Return the median and the largest number of candidates that ambiguous answers list; None without such."""
    counts = [len(x.candidates) for x in cases if x.answer.verdict == "ambiguous"]
    return (median(counts), max(counts)) if counts else None


def seconds_of(cases: Sequence[Judged]) -> tuple[float, float]:
    """Return the median and the largest wall time of a diagnosis."""
    times = [x.answer.seconds for x in cases]
    return median(times), max(times)
