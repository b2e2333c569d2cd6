"""Functions that run where their plant lives: in this process, or whole in the process that has the FMU."""

import functools
import pickle
from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec, TypeVar

from bender_loop.control.plant import Plant

P = ParamSpec("P")
R = TypeVar("R")
RunThere = Callable[[Callable[..., Any], tuple[Any, ...], dict[str, Any]], Any]
"""Called with a function of a module, and what follows on the plant; returns what the function returns."""


def at_the_plant(function: Callable[Concatenate[Plant, P], R]) -> Callable[Concatenate[Plant, P], R]:
    """Return `function`, run in one go by a plant that says with `run_there` that it lives in another process.

    A step there and back takes some 50 µs, a whole run little more. What the function is given is copied on the way;
    what cannot be copied, such as a function without a name, keeps the function here, step by step.
    """

    @functools.wraps(function)
    def wherever(plant: Plant, *args: P.args, **kwargs: P.kwargs) -> R:
        there = run_there_of(plant)
        if there is None or not _portable(args, kwargs):
            return function(plant, *args, **kwargs)
        return there(wherever, args, kwargs)

    return wherever


def _portable(*given: object) -> bool:
    try:
        pickle.dumps(given)
    except (pickle.PicklingError, AttributeError, TypeError):
        return False
    return True


def run_there_of(plant: object) -> RunThere | None:
    """Return how `plant` runs functions in its own process, None where that is this one."""
    return getattr(plant, "run_there", None)
