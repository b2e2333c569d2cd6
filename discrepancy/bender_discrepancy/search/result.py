"""What a search and its verdict leave: the state from which everything that is told is made."""

from dataclasses import dataclass

from bender_discrepancy.effects.form import Form
from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.records.excerpt import Excerpt
from bender_discrepancy.records.observations import Observations
from bender_discrepancy.search.state import Found
from bender_discrepancy.search.verdict import Verdict
from bender_discrepancy.settings import Settings
from bender_loop.errors import RunError
from bender_loop.records.record import Record
from bender_plant.model import Model


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult:
    """What the workflow found: the search, the verdict on it, what both were made from, and what was not tried.

    `excerpts` says which rows of every record were searched; none where all of them were. The model of `problem` lacks
    the modes of `base` that no reading shows. `witnesses` says what the other channels of the records exclude.
    `candidates` are the forms that were sought.
    """

    base: Model
    records: tuple[Record, ...]
    found: Found
    verdict: Verdict
    settings: Settings
    sensor_step_um: float
    untried: tuple[str, ...] = ()
    excerpts: tuple[Excerpt, ...] = ()
    witnesses: tuple[str, ...] = ()
    candidates: tuple[Form, ...] = ()

    @property
    def problem(self) -> FitProblem:
        """What was searched: the model and the readings that counted at the end."""
        return self.found.problem

    @property
    def bench(self) -> FitProblem:
        """The same as `problem`."""
        return self.found.problem

    @property
    def best(self) -> Fitted:
        """The hypothesis that stands at the end."""
        return self.found.best

    @property
    def searched(self) -> tuple[slice, ...]:
        """The rows of every record in which effects were sought."""
        all_of_them = tuple(slice(0, len(record)) for record in self.records)
        return tuple(x.window for x in self.excerpts) or all_of_them

    @property
    def whole(self) -> tuple[Observations, ...]:
        """The records, all of their rows: those that were not searched are held out."""
        seen = self.problem.observations
        return tuple(x.judged(y) for x, y in zip(self.excerpts, seen, strict=True)) if self.excerpts else seen


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
