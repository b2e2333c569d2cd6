"""Our reliable beetle: antennae, heading and step as in beetle antennae search, with nothing left to luck.

Against `bas`, whose weaknesses are a schedule that shrinks whatever happens and one random heading at a time:

* Headings come d at a time, as an orthonormal frame, and every heading has an antenna length of its own. The first
  frame lies along the axes (a loss depends on the logarithms of gains mostly one by one), in random order and sense.
* After smelling left and right the beetle knows three points on a line. It goes to the vertex of the parabola through
  them, as far as three antennae; where the line bends the other way it strides on downhill. It only ever moves to a
  point that is better.
* An antenna grows after a long stride and shrinks when its line holds nothing better: the steps follow success.
* The beetle remembers where it came from. After a round over the frame the way covered is one more heading, whose left
  antenna is the place where the round before ended: one new point gives one more parabola (a pattern move after
  Hooke and Jeeves, doi:10.1145/321062.321069). Ways add up, so the beetle gathers speed along a valley.
* Where all antennae smell the same (a plateau of failed loops) the beetle lengthens them and takes a random frame.
  Where all have shrunk to nothing it has arrived, and the remaining budget goes to another beetle at a random
  place; the best point of all is kept.
"""

from collections.abc import Generator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bender_tuner.optimisers.search import Point, Probe, Search, Task

_SAME_POINT = 1e-9


@dataclass(frozen=True, slots=True)
class Settings:
    """How the beetle behaves; lengths are parts of the unit box.

    Attributes:
        antenna: length of every antenna at the start.
        shortest: an antenna shrinks no further; when all are there, the beetle has arrived.
        longest: an antenna grows no further.
        growth: factor after a stride of more than one and a half antennae.
        shrinkage: factor after a stride of less than one antenna.
        reach: longest stride, in antennae.
        worthwhile: a point nearer than this to one that is known is not evaluated, in antennae.

    Raises:
        ValueError: a length is not positive or the lengths are out of order, or a factor lies on the wrong side of 1.
    """

    antenna: float = 0.1
    shortest: float = 1e-3
    longest: float = 0.5
    growth: float = 2.0
    shrinkage: float = 0.5
    reach: float = 3.0
    worthwhile: float = 0.1

    def __post_init__(self) -> None:
        if not 0.0 < self.shortest < self.antenna <= self.longest <= 1.0:
            raise ValueError(
                "lengths must satisfy 0 < shortest < antenna <= longest <= 1, found "
                f"shortest {self.shortest!r}, antenna {self.antenna!r}, longest {self.longest!r}"
            )
        for name, low, high in (
            ("growth", 1.0, np.inf),
            ("shrinkage", 0.0, 1.0),
            ("reach", 1.0, np.inf),
            ("worthwhile", 0.0, 1.0),
        ):
            if not low < getattr(self, name) < high:
                raise ValueError(f"{name} must lie between {low:g} and {high:g}, found {getattr(self, name)!r}")


class Spot(NamedTuple):
    """A place and what it smells of."""

    x: Point
    f: float


class Stride(NamedTuple):
    """What smelling along one line came to: the better place, how far it lies, and whether all three were equal."""

    spot: Spot
    length: float
    is_flat: bool


def search(task: Task, settings: Settings = Settings()) -> Search:
    """Rounds over a frame of headings, until all antennae are at their shortest."""
    rng, dimension = task.rng, task.dimension
    x = np.full(dimension, 0.5) if task.start is None else task.start
    camp = beetle = Spot(x, (yield Probe(x)))
    frame = axes_frame(rng, dimension)
    antennae = np.full(dimension, settings.antenna)
    while True:
        flat_lines = 0
        for i, heading in enumerate(frame):
            stride = yield from sniff(beetle, heading, antennae[i], settings)
            beetle = stride.spot
            antennae[i] = adapted(antennae[i], stride.length, settings)
            flat_lines += stride.is_flat
        if flat_lines == dimension:
            # Every antenna was just shrunk for finding nothing: undo that, then double.
            antennae[:] = min(2.0 * antennae.max() / settings.shrinkage, settings.longest)
            frame = random_frame(rng, dimension)
            continue
        if beetle.f < camp.f:
            camp, beetle = beetle, (yield from follow_memory(camp, beetle, frame, settings))
        if antennae.max() <= settings.shortest:
            return


def sniff(
    here: Spot, heading: Point, antenna: float, settings: Settings, left: Spot | None = None
) -> Generator[Probe, float, Stride]:
    """Smell right and left of `here` (a `left` that is known is not smelled again), then step along the line."""
    right = yield from visit(here, here.x + antenna * heading)
    if left is None:
        left = yield from visit(here, here.x - antenna * heading)
    near = right if right.f < left.f else left
    descends = near.f < here.f
    best, length = (near, antenna) if descends else (here, 0.0)
    step = signed_step(here, left, right, heading, settings.reach * antenna)
    known = 0.0 if not descends else antenna if near is right else -antenna
    if step is not None and abs(step - known) > settings.worthwhile * antenna:
        spot = yield from visit(best, here.x + step * heading)
        if spot.f < best.f:
            best, length = spot, abs(step)
    return Stride(best, length, right.f == left.f == here.f)


def visit(here: Spot, x: Point) -> Generator[Probe, float, Spot]:
    """Evaluate `x`, clipped to the box; infinitely bad, unevaluated, if the wall leaves the beetle where it is."""
    x = np.clip(x, 0.0, 1.0)
    if np.max(np.abs(x - here.x)) < _SAME_POINT:
        return Spot(x, np.inf)
    return Spot(x, (yield Probe(x)))


def signed_step(here: Spot, left: Spot, right: Spot, heading: Point, longest: float) -> float | None:
    """Coordinate along `heading` to step to, or None if the line promises nothing.

    The vertex of the parabola through the three spots if it is a minimum on the side of the better antenna, else the
    longest step to that side; a beetle between two worse antennae only steps to a vertex.
    """
    t_left, t_right = float(heading @ (left.x - here.x)), float(heading @ (right.x - here.x))
    vertex = parabola_vertex(t_left, left.f, here.f, t_right, right.f)
    if min(left.f, right.f) >= here.f:
        return vertex
    side = 1.0 if right.f < left.f else -1.0
    if vertex is None or vertex * side <= 0.0:
        return side * longest
    return side * min(vertex * side, longest)


def parabola_vertex(t_left: float, f_left: float, f_here: float, t_right: float, f_right: float) -> float | None:
    """Where the parabola through (t_left, f_left), (0, f_here), (t_right, f_right) is smallest; None if nowhere.

    Needs t_left < 0 < t_right and finite values, else None.
    """
    if not (t_left < 0.0 < t_right and np.isfinite(f_left + f_here + f_right)):
        return None
    slope_right = (f_right - f_here) / t_right
    slope_left = (f_left - f_here) / t_left
    curvature = (slope_right - slope_left) / (t_right - t_left)
    if curvature <= 0.0:
        return None
    return (curvature * t_right - slope_right) / (2.0 * curvature)


def adapted(antenna: float, length: float, settings: Settings) -> float:
    """The antenna after a stride of `length` along its heading (0 = none)."""
    if length > 1.5 * antenna:
        return min(settings.growth * antenna, settings.longest)
    if length < antenna:
        return max(settings.shrinkage * antenna, settings.shortest)
    return antenna


def follow_memory(camp: Spot, here: Spot, frame: Point, settings: Settings) -> Generator[Probe, float, Spot]:
    """Go on along the way from `camp`, unless it follows a single heading, whose line is known already."""
    way = here.x - camp.x
    if np.count_nonzero(np.abs(frame @ way) > _SAME_POINT) < 2:
        return here
    length = float(np.linalg.norm(way))
    stride = yield from sniff(here, way / length, length, settings, left=camp)
    return stride.spot


def axes_frame(rng: np.random.Generator, dimension: int) -> Point:
    """The axes as headings, shape (d, d), one in each row, in random order and sense."""
    return np.eye(dimension)[rng.permutation(dimension)] * rng.choice([-1.0, 1.0], (dimension, 1))


def random_frame(rng: np.random.Generator, dimension: int) -> Point:
    """Random orthonormal headings, shape (d, d), one in each row."""
    q, r = np.linalg.qr(rng.standard_normal((dimension, dimension)))
    # The signs make the rotation uniform over the orthogonal group (Mezzadri 2007, Notices AMS 54:592).
    return q * np.sign(np.diag(r))
