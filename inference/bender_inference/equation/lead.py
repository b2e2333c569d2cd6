"""A lead where the catalogue has no name: a sparse equation for the residual, found with PySINDy.

It is fitted on the rows of the fits, its number of terms is chosen on a part of them, and what it explains is measured
on the held-out rows, where it runs freely from the beginning of the record: never from one reading to the next.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bender_inference.equation.lead_choice import choose_equation
from bender_inference.equation.lead_fit import Equation, Ground
from bender_inference.equation.lead_terms import AT_ONCE, AT_ONCE_TIMED, RATE_INDEPENDENT, RELAXING, equation
from bender_inference.equation.lead_track import tracks
from bender_inference.records.observations import Array, Mask
from bender_inference.search.noise import floor_square_um2
from bender_plant.parameter import ModelError
from bender_report.wording import percent, plain

if TYPE_CHECKING:
    from bender_inference.search.result import SearchResult

MOST_ROWS, FEWEST_ROWS = 12_000, 12
# a gap that is no larger over the noise has no equation
NO_GAP_OVER_NOISE = 1.1
# the least part of the residual, above the noise, that is worth telling
LEAST_SHARE = 0.1
# what it may add to some held-out blocks, over what it removes from others: chance does both alike
MOST_SPOILT = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """What is left of one record and what the equation gives for it, arrays of shape (n,) over the rows used.

    `held_out` are the rows that its fit did not see.
    """

    rows: NDArray[np.intp]
    left_um: Array
    gives_um: Array
    held_out: Mask


@dataclass(frozen=True, slots=True, eq=False)
class Lead:
    """A sparse equation for the residual, or the reason why there is none.

    Attributes:
        equation: None where none was found.
        explains: part of the variance above the noise on held-out rows that its free run removes.
        rows: readings that it was fitted to and judged on.
        reason: why there is none, "" where there is one.
        drawn: what it gives, for every record.
    """

    equation: Equation | None
    explains: float = 0.0
    rows: int = 0
    reason: str = ""
    drawn: tuple[Drawn, ...] = ()

    @property
    def text(self) -> str:
        """The equation as it is read, "" where there is none."""
        x = self.equation
        return equation(x.terms, x.coefficients, x.per_second) if x else ""

    def to_dict(self) -> dict[str, Any] | None:
        """Return the entry `lead` of `diagnosis.json`, None where there is none."""
        x = self.equation
        if x is None:
            return None
        terms = [
            {"term": _ascii(t.name), "coefficient": c, "unit": t.unit(x.per_second)}
            for t, c in zip(x.terms, x.coefficients, strict=True)
        ]
        return {"equation": _ascii(self.text), "terms": terms, "explains": round(self.explains, 4), "rows": self.rows}


def _ascii(text: str) -> str:
    return plain(text.replace("²", "^2").replace("³", "^3"))


def find_lead(search: "SearchResult") -> Lead:
    """Return a sparse equation for what the best hypothesis leaves, or why there is none."""
    timed = not search.settings.untimed
    terms = (*RELAXING, *RATE_INDEPENDENT) if timed else RATE_INDEPENDENT
    at_once = (*AT_ONCE, *AT_ONCE_TIMED) if timed else AT_ONCE
    try:
        records = tracks(search.problem, search.best, terms, MOST_ROWS)
    except (ModelError, ArithmeticError) as error:
        # fits take longer sub-steps, in which a memory on the edge of stability may have stayed calm
        return Lead(None, reason=f"the model cannot be simulated in its own sub-steps ({error})")
    ground = Ground.of(records, at_once, floor_square_um2(search.problem, search.archive.noise_um))
    judging = ground.mask(lambda x: x.judging)
    usable = ground.mask(lambda x: x.usable)
    if min(int(judging.sum()), int((usable & ~judging).sum())) < FEWEST_ROWS:
        return Lead(None, reason="there are too few readings")
    if float(np.mean(ground.left_um[judging] ** 2)) < NO_GAP_OVER_NOISE**2 * ground.noise_square:
        return Lead(None, reason="on held-out readings the residual is hardly more than noise")
    best = choose_equation(ground)
    share = ground.share(best, judging) if best else 0.0
    if best is None or not share >= LEAST_SHARE or ground.spoils(best, _held_out_blocks(ground)) > MOST_SPOILT:
        least = percent(LEAST_SHARE)
        return Lead(None, reason=f"no equation of few terms explains {least} of the residual on held-out readings")
    return Lead(best, share, int(usable.sum()), "", _drawn(ground, best))


def _held_out_blocks(ground: Ground) -> list[Mask]:
    """Return the held-out readings block by block."""
    judging = ground.mask(lambda x: x.judging)
    rows = np.flatnonzero(judging)
    held_out = np.concatenate([x.held_out for x in ground.tracks])
    block = np.cumsum(np.diff(held_out, prepend=False))[rows]
    return [_only(rows[block == k], judging.size) for k in np.unique(block)]


def _only(rows: NDArray[np.intp], count: int) -> Mask:
    found = np.zeros(count, dtype=bool)
    found[rows] = True
    return found


def _drawn(ground: Ground, best: Equation) -> tuple[Drawn, ...]:
    gives = ground.split(best.gives_um)
    return tuple(Drawn(x.rows, x.left_um, y, x.held_out) for x, y in zip(ground.tracks, gives, strict=True))
