"""What a search and its verdict leave: the state from which everything that is told is made."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bender_effects.form import Form
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.output_error import Fitted
from bender_inference.records.excerpt import Excerpt
from bender_inference.records.observations import Observations
from bender_inference.search.archive import Archive
from bender_inference.search.judgement.grades import (
    Doubt,
    Grades,
    at_most_likely,
    contradicted,
    doubted,
    grade,
    relevant_part,
)
from bender_inference.search.judgement.rules import Rules
from bender_inference.search.judgement.verdict import Verdict, decide
from bender_inference.search.search import Searched, parsimonious
from bender_inference.settings import Settings
from bender_loop.errors import RunError
from bender_loop.records.record import Record
from bender_loop.records.telling_rows import Rows
from bender_plant.model import Model


def rules_for(settings: Settings) -> Rules:
    """Return the constants that decide under these settings."""
    return Rules(confidence=settings.confidence, relevant=settings.relevant)


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult:
    """What the workflow found: the search, the verdict on it, what both were made from, and what was not tried.

    Attributes:
        base: the model as given.
        records: of one bench.
        found: by the search.
        grades: how sure its effects are.
        verdict: the contract's word.
        settings: how the records were read.
        sensor_step_um: step of coarse readings, 0 where they are fine.
        untried: effects whose simulation would take too long.
        excerpts: which rows of every record were searched; none where all of them were. The model of `problem` lacks
            the modes of `base` that no reading shows.
        witnesses: what the other channels of the records exclude.
        candidates: the forms that were sought.
        immaterial: effects that were found, but that nobody would miss (`Rules.relevant`).
        seen_on_all: of every record, rows from all over it that numbers were fitted to as well; none where none were.
    """

    base: Model
    records: tuple[Record, ...]
    found: Searched
    grades: Grades
    verdict: Verdict
    settings: Settings
    sensor_step_um: float
    untried: tuple[str, ...] = ()
    excerpts: tuple[Excerpt, ...] = ()
    witnesses: tuple[str, ...] = ()
    candidates: tuple[Form, ...] = ()
    immaterial: tuple[str, ...] = ()
    seen_on_all: tuple[Rows, ...] = ()

    @property
    def rules(self) -> Rules:
        """The constants that decided."""
        return rules_for(self.settings)

    @property
    def archive(self) -> Archive:
        """Every fit of the search."""
        return self.found.archive

    @property
    def problem(self) -> FitProblem:
        """What was searched: the model and the readings that counted at the end."""
        return self.found.archive.problem

    @property
    def best(self) -> Fitted:
        """The hypothesis that stands at the end."""
        return self.found.best

    @property
    def searched(self) -> tuple[Rows, ...]:
        """The rows of every record in which effects were sought."""
        all_of_them = tuple(np.arange(len(record)) for record in self.records)
        return tuple(x.rows for x in self.excerpts) or all_of_them

    @property
    def whole(self) -> tuple[Observations, ...]:
        """The records, all of their rows: those that no fit used are held out."""
        seen = self.problem.observations
        if not self.excerpts:
            return seen
        whole = tuple(x.judged(y) for x, y in zip(self.excerpts, seen, strict=True))
        return (
            tuple(x.fitted_on(y) for x, y in zip(whole, self.seen_on_all, strict=True)) if self.seen_on_all else whole
        )

    def with_search(self, found: Searched, judged: Callable[[Verdict], Verdict] = lambda x: x) -> "SearchResult":
        """Return the result with something else found, graded anew."""
        grades = grade(found, self.rules)
        return replace(self, found=found, grades=grades, verdict=judged(decide(found, grades, self.rules)))

    def without_certainty(self, reason: str, closed: float | None = None, *, complete: bool = False) -> "SearchResult":
        """Return the result with none of its effects certain, and why.

        Args:
            reason: in one sentence.
            closed: part of the gap that unseen rows close; None where they contradict nothing.
            complete: whether nothing is left above the noise floor.
        """
        lowered = (at_most_likely(x) if closed is None else contradicted(x, closed) for x in self.grades.effects)
        effects = tuple(lowered)
        word = "likely" if self.verdict.word == "named" else self.verdict.word
        verdict = Verdict(word, reason, complete)
        return replace(self, grades=replace(self.grades, effects=effects), verdict=verdict)

    def with_doubts(self, doubts: Mapping[int, Doubt]) -> "SearchResult":
        """Return the result where the final numbers of some effects, by index, leave open whether they are there."""
        if not any(x.grade == "certain" for x in self.grades.effects if x.index in doubts):
            return self
        effects = tuple(doubted(x, doubts[x.index]) if x.index in doubts else x for x in self.grades.effects)
        grades = replace(self.grades, effects=effects)
        verdict = replace(decide(self.found, grades, self.rules), complete=self.verdict.complete)
        return replace(self, grades=grades, verdict=verdict)

    def next_best(self) -> list["SearchResult"]:
        """Return results with other effects: the simplest of those that predict as well as the best of them, and that.

        Only what predicts better than the linear structure alone counts, with all that a witness shows; of an excerpt
        there are none. What is refuted is no rival of what takes its place.
        """
        if self.excerpts:
            return []
        archive, refuted = self.archive, self.best.hypothesis
        others = [x for x in archive.fits if set(x.hypothesis.effects) != set(refuted.effects)]
        least = archive.best(x for x in others if self.rules.is_in_range(archive, x))
        tried = [parsimonious(archive, self.rules, refuted=self.best), *([] if least is None else [least])]
        closer = [archive.fit(x.hypothesis, closely=True) or x for x in dict.fromkeys(tried)]
        found = [relevant_part(replace(self.found, best=x), self.rules) for x in closer]
        better = {
            frozenset(x.best.hypothesis.effects): x
            for x in reversed(found)
            if x.best.hypothesis.parts
            and x.best.hypothesis.structure is refuted.structure
            and x.best.hypothesis.keeps_shown_of(refuted)
            and self.rules.is_preferred(archive, x.best, self.found.base)
        }
        better.pop(frozenset(refuted.effects), None)
        return [self.with_search(x)._without_rivals(set(refuted.effects)) for x in reversed(better.values())]

    def _without_rivals(self, refuted: set[str]) -> "SearchResult":
        effects = tuple(
            replace(x, rivals=tuple(y for y in x.rivals if set(y.fitted.hypothesis.effects) != refuted))
            for x in self.grades.effects
        )
        grades = replace(self.grades, effects=effects)
        return replace(self, grades=grades, verdict=decide(self.found, grades, self.rules))

    def without_effects(self, reason: str) -> "SearchResult":
        """Return the result as if nothing had been found, and why, where more than noise is left then."""
        found = replace(self.found, best=self.found.base)
        grades = grade(found, self.rules)
        verdict = decide(found, grades, self.rules)
        if verdict.word == "unexplained":
            verdict = replace(verdict, reason=reason)
        return replace(self, found=found, grades=grades, verdict=verdict)


class BrokenOffError(RunError):
    """The corrected FMU could not be driven; `search` is what was found before."""

    def __init__(self, problem: str, search: SearchResult) -> None:
        super().__init__(problem)
        self.search = search


class Interrupted(KeyboardInterrupt):
    """Interrupted by the user; `search` is what was ranked until then, by a whole search if `searched`."""

    def __init__(self, search: SearchResult, searched: bool = False) -> None:
        super().__init__("interrupted")
        self.search, self.searched = search, searched
