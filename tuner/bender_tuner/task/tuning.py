"""The methods at work: searches by ask and tell, and the design rules beside them."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from bender_loop.control.pid import Gains
from bender_loop.errors import RunError
from bender_tuner.model.ultimate import RelayTest
from bender_tuner.optimisers import METHODS, create
from bender_tuner.rules.simc import FILTER_PERIODS, simc
from bender_tuner.rules.ziegler_nichols import ZieglerNichols, ziegler_nichols
from bender_tuner.task.objectives import at_point
from bender_tuner.task.problem import TuningProblem
from bender_tuner.task.search_space import DIMENSION, GainSpace, SearchSpace

_RELAY_SHARE = 0.06
_LARGEST_SHARE_OF_ROOM = 0.9

Listener = Callable[[int, int, float], None]
"""Called with (evaluations done, budget, best value)."""


class Ended(Enum):
    """How a search came to its end."""

    COMPLETE = "complete"
    INTERRUPTED = "interrupted"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Evaluation:
    """One row of a search's history.

    Attributes:
        gains: tried; None where the point stood for no gains.
        value: of the objective.
        best: smallest value so far that the method may keep.
    """

    gains: Gains | None
    value: float
    best: float


@dataclass(frozen=True, slots=True)
class SearchResult:
    """A search, finished or not.

    Attributes:
        method: its name.
        gains: the best found; None where nothing was found that holds.
        value: of the objective there, inf without gains.
        history: every evaluation.
        budget: evaluations that were planned.
        ended: how.
        reason: what failed, empty otherwise.
    """

    method: str
    gains: Gains | None
    value: float
    history: tuple[Evaluation, ...]
    budget: int
    ended: Ended
    reason: str = ""


def run_search(
    problem: TuningProblem,
    method: str,
    *,
    seed: int | None = None,
    on_evaluation: Listener | None = None,
) -> SearchResult:
    """Search with `method` over the budget of the problem; an interrupt or a failing plant keeps the best so far.

    Args:
        problem: what to minimise and where to begin.
        method: a key of `METHODS`.
        seed: of the search; that of the settings unless given.
        on_evaluation: listener.

    Raises:
        InputError: no such method.
    """
    settings, raw = problem.settings, method in METHODS and METHODS[method].space == "raw"
    space = problem.space(raw=raw)
    rng = np.random.default_rng(settings.seed if seed is None else seed)
    optimiser = create(
        method,
        DIMENSION,
        rng,
        start=space.start() if isinstance(space, SearchSpace) else None,
        budget=settings.evaluations,
    )
    history: list[Evaluation] = []
    ended, reason = Ended.COMPLETE, ""
    try:
        while len(history) < settings.evaluations:
            x = optimiser.ask()
            value = at_point(problem.objective, space, x)
            optimiser.tell(x, value)
            history.append(Evaluation(_gains_or_none(space, x), value, optimiser.best_f))
            if on_evaluation is not None:
                on_evaluation(len(history), settings.evaluations, optimiser.best_f)
    except KeyboardInterrupt:
        ended = Ended.INTERRUPTED
    except RunError as error:
        ended, reason = Ended.FAILED, str(error)
    finally:
        optimiser.close()
    gains = _gains_or_none(space, optimiser.best_x) if np.isfinite(optimiser.best_f) else None
    return SearchResult(method, gains, optimiser.best_f, tuple(history), settings.evaluations, ended, reason)


def simc_gains(problem: TuningProblem) -> Gains:
    """Skogestad's closed formula for the reduced model of the problem's loop."""
    return simc(problem.reduced, filter_time_s=_filter_time_s(problem))


def ziegler_nichols_rule(problem: TuningProblem) -> ZieglerNichols:
    """Ziegler and Nichols' rule on the problem's loop, by linear analysis and by a relay of 6 % of the limits.

    The derivative is filtered as in every other set of gains here.
    """
    settings, point = problem.settings, problem.operating_point
    room_V = min(point.voltage_V - settings.lower_V, settings.upper_V - point.voltage_V)
    amplitude_V = min(_RELAY_SHARE * (settings.upper_V - settings.lower_V), _LARGEST_SHARE_OF_ROOM * room_V)
    relay = RelayTest(amplitude_V) if amplitude_V > 0.0 else None
    return ziegler_nichols(
        problem.experiment.plant,
        problem.ensemble.nominal.linearisation,
        settings.sampling,
        relay,
        filter_time_s=_filter_time_s(problem),
    )


def _filter_time_s(problem: TuningProblem) -> float:
    return FILTER_PERIODS * problem.settings.sampling.period_s


def _gains_or_none(space: GainSpace, x: np.ndarray) -> Gains | None:
    try:
        return space.to_gains(x)
    except ValueError:
        return None
