"""The table of methods and the one way to make an optimiser.

Standard library only until `create` is called: a command line can list the methods without loading numpy.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Literal

from bender_loop.errors import InputError
from bender_tuner.optimisers.optimiser import Optimiser

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike

    from bender_tuner.optimisers.search import Point

DEFAULT_BUDGET = 151
"""One first point and 50 iterations of a beetle: right antenna, left antenna, step."""


@dataclass(frozen=True, slots=True)
class MethodInfo:
    """One row of the table.

    Attributes:
        name: how it is asked for.
        description: one line for people.
        source: paper or standard reference.
        library: who wrote the code ("own" or a distribution).
        module: file of the algorithm in this package.
        space: "box" if it asks for points of the unit box, "raw" if for unbounded raw coordinates.
    """

    name: str
    description: str
    source: str
    library: str
    module: str
    space: Literal["box", "raw"] = "box"


_ROWS = (
    MethodInfo(
        "bas_printed",
        "beetle antennae search exactly as the paper prints it (climbs), on raw gains",
        "Musa & Wejinya 2024, Algorithm 1, equations (22)-(27)",
        "own",
        "beetle.bas_printed",
        space="raw",
    ),
    MethodInfo(
        "bas",
        "beetle antennae search with the sign corrected, in a unit box, antennae count as candidates",
        "Jiang & Li 2017, arXiv:1710.10724",
        "own",
        "beetle.bas",
    ),
    MethodInfo(
        "reliable_bas",
        "beetle antennae search with orthogonal headings, an antenna length for each, and parabolic steps",
        "this project; pattern moves after Hooke & Jeeves 1961, doi:10.1145/321062.321069",
        "own",
        "beetle.reliable_bas",
    ),
    MethodInfo("random", "uniform random points", "the yardstick", "numpy", "random_points"),
    MethodInfo(
        "differential_evolution",
        "differential evolution, best/1/bin, small population",
        "Storn & Price 1997, doi:10.1023/A:1008202821328",
        "scipy",
        "differential_evolution",
    ),
    MethodInfo(
        "nelder_mead",
        "Nelder-Mead simplex, restarted at random when it has collapsed",
        "Nelder & Mead 1965, doi:10.1093/comjnl/7.4.308",
        "scipy",
        "nelder_mead",
    ),
    MethodInfo(
        "pattern_search",
        "Hooke-Jeeves pattern search",
        "Hooke & Jeeves 1961, doi:10.1145/321062.321069",
        "own",
        "pattern_search",
    ),
    MethodInfo(
        "pso",
        "particle swarm with inertia, sized and set for small budgets",
        "Kennedy & Eberhart 1995, doi:10.1109/ICNN.1995.488968",
        "own",
        "populations.pso",
    ),
    MethodInfo(
        "ga",
        "real-coded genetic algorithm (simulated binary crossover, polynomial mutation)",
        "Deb & Agrawal 1995, Complex Systems 9(2):115-148",
        "own",
        "populations.ga",
    ),
)

METHODS: dict[str, MethodInfo] = {row.name: row for row in _ROWS}


def create(
    name: str,
    dimension: int,
    rng: "np.random.Generator",
    start: "ArrayLike | None" = None,
    budget: int = DEFAULT_BUDGET,
) -> Optimiser:
    """Make an optimiser.

    Args:
        name: a key of `METHODS`.
        dimension: number of coordinates d >= 1.
        rng: source of all randomness: the same state gives the same sequence of points for the same answers.
        start: first point, shape (d,), in the unit box (any finite point where `space` is "raw"); None leaves it to
            the method: the centre of the box for local searches, random for populations, U[0, 1]^d for
            `bas_printed`. Populations hold the start as one member.
        budget: evaluations planned; sizes populations. Asking for more is always possible.

    Raises:
        InputError: no such method.
        ValueError: `dimension` or `budget` below 1, or `start` of the wrong shape, not finite, or outside the box.
    """
    if name not in METHODS:
        raise InputError(f"method {name!r} is unknown: choose one of {', '.join(METHODS)}")
    for label, value in (("dimension", dimension), ("budget", budget)):
        if value < 1:
            raise ValueError(f"{label} must be >= 1, found {value!r}")
    from bender_tuner.optimisers.ask_tell import AskTell
    from bender_tuner.optimisers.search import Task

    method = METHODS[name]
    point = None if start is None else _checked_start(start, dimension, method.space)
    search = import_module(f"{__package__}.{method.module}").search
    return AskTell(search, Task(dimension, rng, point, budget))


def _checked_start(start: "ArrayLike", dimension: int, space: str) -> "Point":
    import numpy as np

    point = np.array(start, dtype=float)
    if point.shape != (dimension,):
        raise ValueError(f"start must have shape ({dimension},), found {point.shape}")
    if not np.all(np.isfinite(point)):
        raise ValueError(f"start must be finite, found {point.tolist()}")
    if space == "box" and not np.all((point >= 0.0) & (point <= 1.0)):
        raise ValueError(f"start must lie in [0, 1]^{dimension}, found {point.tolist()}")
    return point
