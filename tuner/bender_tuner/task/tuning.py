"""The methods at work: searches by ask and tell, and the design rules beside them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
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
from bender_tuner.task.search_space import DIMENSION, GAIN_NAMES, GainSpace, SearchSpace

_RELAY_SHARE = 0.06
_GROWTHS, _GROWTH = 2, 1.6
"""How often a box grows, and by how much in decades."""
_LARGEST_SHARE_OF_ROOM = 0.9

Listener = Callable[[int, int, float], None]
"""Called with (evaluations done, budget, best value)."""


class Ended(Enum):
    """How a search came to its end; a tuning is refused where its gains break what was asked of them."""

    COMPLETE = "complete"
    REFUSED = "refused"
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


def search_in_growing_box(
    problem: TuningProblem, method: str, *, on_evaluation: Listener | None = None
) -> SearchResult:
    """Search, and where the best gains break the bounds of the practitioner search again in a wider box around them.

    Only the practitioner's objective has bounds, and a box that was given gain by gain is left as it is. Every search
    has the whole budget; the history is that of all of them.

    Args:
        problem: what to minimise and where to begin.
        method: a key of `METHODS`.
        on_evaluation: listener.

    Raises:
        InputError: no such method.
    """
    found = run_search(problem, method, on_evaluation=on_evaluation)
    settings = problem.settings
    if settings.objective != "practitioner" or settings.gain_bounds or METHODS[method].space == "raw":
        return found
    for _ in range(_GROWTHS):
        if found.ended is not Ended.COMPLETE or found.gains is None or problem.keeps_bounds(found.gains):
            break
        settings = replace(settings, decades=_GROWTH * settings.decades)
        around = replace(problem, settings=settings, first_guess=_inside(found.gains, problem.first_guess))
        again = run_search(around, method, on_evaluation=on_evaluation)
        best = min(found, again, key=lambda run: run.value)
        history = _continued(found.history, again.history)
        found = replace(again, gains=best.gains, value=best.value, history=history, budget=found.budget + again.budget)
    return found


def _inside(gains: Gains, guess: Gains) -> Gains:
    """Return gains that can be the centre of a logarithmic box: one of zero takes a small part of the guess."""
    floor = {name: 1e-3 * getattr(guess, name) for name in GAIN_NAMES}
    return replace(gains, **{name: max(getattr(gains, name), low) for name, low in floor.items()})


def _continued(first: tuple[Evaluation, ...], second: tuple[Evaluation, ...]) -> tuple[Evaluation, ...]:
    best = first[-1].best if first else np.inf
    return (*first, *(replace(x, best=min(x.best, best)) for x in second))


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
