"""Everything that competes on one problem: searches, rules and the first guess, each with its judgement."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from bender_loop.control.pid import Gains
from bender_loop.errors import RunError
from bender_tuner.model.monte_carlo import MonteCarloResult
from bender_tuner.optimisers.methods import METHODS
from bender_tuner.rules.ziegler_nichols import Rule, ZieglerNichols
from bender_tuner.task.following import Following
from bender_tuner.task.judgement import Judgement, judge
from bender_tuner.task.problem import TuningProblem
from bender_tuner.task.search_space import SearchSpace, edges
from bender_tuner.task.tuning import SearchResult, simc_gains

Kind = Literal["search", "rule", "start", "following"]
START = "first guess"


@dataclass(frozen=True, slots=True, eq=False)
class Contender:
    """One set of gains in the running.

    Attributes:
        method: as it is asked for: a search, `zn`, `simc`, or `start`.
        label: for people.
        kind: where the gains come from.
        gains: None where the method has none to offer.
        remark: what the method says of itself, empty for nothing.
        judgement: None until judged, or where the plant failed.
        monte_carlo: None until run.
        following: the model that the controller follows, None for the PID block alone.
    """

    method: str
    label: str
    kind: Kind
    gains: Gains | None
    remark: str = ""
    judgement: Judgement | None = None
    monte_carlo: MonteCarloResult | None = None
    following: Following | None = None


def line_up(
    problem: TuningProblem, searches: Iterable[SearchResult], ziegler_nichols: ZieglerNichols
) -> list[Contender]:
    """The contenders, the asked method first, the first guess last; not judged yet."""
    found = [Contender(run.method, run.method, "search", run.gains, _remark(problem, run)) for run in searches]
    rules = [
        Contender("zn", "Ziegler-Nichols", "rule", ziegler_nichols.gains.get(Rule.PID), ziegler_nichols.sentence),
        Contender("simc", "SIMC", "rule", simc_gains(problem)),
    ]
    ordered = [*found, *rules, Contender("start", START, "start", problem.first_guess)]
    return sorted(ordered, key=lambda contender: contender.method != problem.settings.method)


def judged(problem: TuningProblem, contender: Contender) -> Contender:
    """`contender` with its judgement; without one where it has no gains or the plant fails under them."""
    if contender.gains is None:
        return contender
    try:
        return replace(contender, judgement=judge(problem, contender.gains, contender.following))
    except RunError as error:
        return replace(contender, remark=f"{contender.remark} {error}".strip())


def _remark(problem: TuningProblem, run: SearchResult) -> str:
    if run.gains is None:
        return f"found no gains under which the loop holds in {len(run.history)} evaluations"
    if len(run.history) < run.budget:
        return f"ended after {len(run.history)} of {run.budget} evaluations"
    space = problem.space(raw=METHODS[run.method].space == "raw")
    on_edges, on_bounds = edges(space, run.gains) if isinstance(space, SearchSpace) else ([], [])
    said = []
    if on_edges:
        said.append(
            f"{' and '.join(on_edges)} of the search box, {problem.settings.decades:g} decades either side of the "
            "first guess: a better value may lie beyond, --decades widens the box"
        )
    if on_bounds:
        said.append(f"{' and '.join(on_bounds)}: a better value may lie beyond what --bounds allows")
    return "; ".join(said)
