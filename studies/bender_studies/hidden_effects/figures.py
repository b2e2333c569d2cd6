"""What the judgements come to: shares of right answers beside what is promised, and who was taken for whom."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import median

from bender_studies.hidden_effects.judging import HIDDEN, MOST_CANDIDATES, SIDES_ALIKE, Judged

LEFT_OVER_FLOOR = 1.2
CONFIDENCE = 1.96
SEVERAL = ((3, "three", 0.92), (4, "four", 0.85), (5, "five", 0.70))
MOVED = ((0.05, 0.97), (0.1, 0.93), (0.2, 0.85))
WAYS = (
    ("a model that is a little wrong in frequency, damping and gain", ("approximate",), 0.97),
    ("a model whose sensor lags by another time", ("lagging",), 0.97),
    ("begun in motion or with a step", ("motion", "step"), 0.97),
    ("closed loop", ("loop",), 0.97),
)


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


def share(
    words: str, promised: float, cases: Sequence[Judged], test: Callable[[Judged], bool], *, at_most: bool = False
) -> Figure:
    """Return the share of cases that pass a test."""
    count = len(cases)
    if not count:
        return Figure(words, math.nan, promised, 0, at_most)
    part = sum(test(x) for x in cases) / count
    return Figure(words, part, promised, count, at_most, interval=wilson(part, count))


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

    singles, weak = [x for x in of("single") if not x.way], of("weak")
    hidden = [x for x in cases if x.kind in HIDDEN]
    missed = [x for x in hidden if not x.is_right and x.kind in ("pair", "several")]
    gaps = [x.of_second_gap for x in singles if not math.isnan(x.of_second_gap)]
    numbers = [x for x in singles if x.numbers_right is not None]
    found = [
        share("single effect: its name alone", 0.99, singles, lambda x: x.is_right),
        share("single effect: at most 1.2 times the floor is left", 0.90, singles, lambda x: _is_little(x)),
        Figure("single effect: gap left on a second record, median", median(gaps), 0.10, len(gaps), at_most=True)
        if gaps
        else Figure("", math.nan, 0.1, 0),
        share("quantiser or surroundings: size within a tenth", 0.90, numbers, lambda x: bool(x.numbers_right)),
        share("nothing hidden: nothing named, nothing called missing", 1.0, of("nothing"), lambda x: x.is_right),
        share("nothing hidden: no name", 1.0, of("nothing"), lambda x: not x.answer.named),
        share("gain or offset off: recalibrated", 0.90, of("calibration"), lambda x: x.is_right),
        share("two effects: both names alone", 0.96, of("pair"), lambda x: x.is_right),
        *(
            share(
                f"{words} effects: all names alone",
                promised,
                [x for x in of("several") if len(x.truth) == count],
                _right,
            )
            for count, words, promised in SEVERAL
        ),
        share(
            "several effects, not all of them named: a part told as certain, nothing else",
            0.80,
            missed,
            lambda x: x.is_partly_right,
        ),
        share("a gap of about the noise: its name alone", 0.85, of("faint"), _right),
        *(
            share(
                f"form moved by {100 * moved:.0f} %: its name alone",
                promised,
                [x for x in of("moved") if x.moved == moved],
                _right,
            )
            for moved, promised in MOVED
        ),
        *(
            share(
                f"form moved by {100 * moved:.0f} %, no other effect within that: its name alone",
                promised,
                [x for x in of("moved") if x.moved == moved and not x.lookalike],
                _right,
            )
            for moved, promised in MOVED
        ),
        share(
            "form moved, another effect within that: its name, or open with the truth listed",
            0.97,
            [x for x in of("moved") if x.lookalike],
            lambda x: x.is_right or _is_open(x),
        ),
        *(
            share(
                f"form moved by {100 * moved:.0f} %, after the record that an open answer asks for: its name alone",
                promised,
                [x for x in of("moved") if x.moved == moved],
                lambda x: x.is_right_after,
            )
            for moved, promised in MOVED
        ),
        share(
            "form moved, after that record: a false name", 0.02, of("moved"), lambda x: x.is_false_after, at_most=True
        ),
        share("form moved: a false name", 0.02, of("moved"), lambda x: x.is_false_name, at_most=True),
        *(
            share(
                f"single effect, {words}: its name alone", promised, [x for x in of("single") if x.way in ways], _right
            )
            for words, ways, promised in WAYS
        ),
        share("outside the catalogue: no name", 0.97, of("outside"), lambda x: not x.answer.named),
        share("outside the catalogue: unexplained, no name", 0.90, of("outside"), lambda x: x.is_right),
        share(
            "an open answer that asks for a further record: the right name after it",
            0.90,
            [x for x in hidden if x.after is not None],
            lambda x: x.is_right_after,
        ),
        share("something hidden: a false name", 0.01, hidden, lambda x: x.is_false_name, at_most=True),
        share("something hidden: nothing called missing", 0.0, hidden, lambda x: x.is_blind, at_most=True),
        share(
            f"too weakly excited: ambiguous, the truth among at most {MOST_CANDIDATES}",
            0.90,
            weak,
            lambda x: x.is_right,
        ),
        share("the same after the designed experiment: the right name", 0.90, weak, lambda x: x.is_right_after),
    ]
    return [x for x in found if x.count]


def _right(x: Judged) -> bool:
    return x.is_right


def _is_open(x: Judged) -> bool:
    """Return whether it is left open what it is, with the truth listed."""
    return x.answer.verdict == "ambiguous" and set(x.truth) <= set(x.candidates)


def figures_of_fmu(cases: Sequence[Judged]) -> list[Figure]:
    """Return the figures of diagnoses of a nominal FMU: the promises that are made of anybody's model."""
    singles = [x for x in cases if x.kind == "single"]
    told = [x for x in singles if x.truth[0] not in SIDES_ALIKE]
    alike = [x for x in singles if x.truth[0] in SIDES_ALIKE]
    nothing = [x for x in cases if x.kind == "nothing"]
    false = share("an effect was named that is not there", 0.02, cases, lambda x: x.is_false_name)
    found = [
        share("single effect whose side can be told: its name alone", 0.95, told, lambda x: x.is_right),
        share("the same: its name, or open with the truth listed", 0.95, told, lambda x: x.is_honest),
        share("single effect of either side: its name, or open", 0.95, alike, lambda x: x.is_honest),
        share("single effect: at most 1.2 times the floor is left", 0.90, singles, lambda x: _is_little(x)),
        share("nothing hidden: nothing named, nothing called missing", 0.98, nothing, lambda x: x.is_right),
        replace(false, at_most=True),
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
    return Counter(name for x in cases for name in x.false_names)


def candidates_of(cases: Sequence[Judged]) -> tuple[float, int] | None:
    """Return the median and the largest number of candidates that ambiguous answers list; None without such."""
    counts = [len(x.candidates) for x in cases if x.answer.verdict == "ambiguous"]
    return (median(counts), max(counts)) if counts else None


def seconds_of(cases: Sequence[Judged]) -> tuple[float, float]:
    """Return the median and the largest wall time of a diagnosis."""
    times = [x.answer.seconds for x in cases]
    return median(times), max(times)
