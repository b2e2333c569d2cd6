"""The linear structures that compete with the effects where no model of the device is given."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from bender_inference.search.search import Searched
from bender_inference.settings import Settings
from bender_loop.errors import InputError
from bender_loop.records.record import Record
from bender_plant.model import Model

if TYPE_CHECKING:
    from bender_identify.first_model.linear_structures import LinearStructure

AUTO = "auto"
MOST_STRUCTURES, MOST_ORDER = 2, 2
"""Besides a gain alone: the search tries every effect on each. Higher orders imitate what is not linear."""


def between_rows_decided(records: Sequence[Record], how: Settings, names: Sequence[str] = ()) -> Settings:
    """Return the settings with what the command does between the rows, where the records are to decide.

    Raises:
        InputError: nothing can be learned from a record.
    """
    if not how.decide_hold or how.untimed:
        return how
    from bender_identify.first_model.course import course_between_rows

    return replace(how.between_rows(course_between_rows(records, names)), decide_hold=True)


@dataclass(frozen=True, slots=True, eq=False)
class CompetingStructure:
    """A linear structure that competes with others.

    Attributes:
        model: with its numbers.
        hidden: these were fitted beside an effect that hides them: alone, they would fit what is not there.
    """

    model: Model
    hidden: bool = False


def competing_structures(
    records: Sequence[Record], how: Settings, names: Sequence[str] = ()
) -> list[CompetingStructure]:
    """Return linear models of some records: the best that creeps to rest, the best that rings, and a gain alone.

    A lag is a special case of two: beside these it would be tried twice. A delay is an effect of the catalogue, which
    competes with the others: no structure has one, but the one behind a loop. A loop may lead the numbers of the
    others astray, so that one is the first of them. Where time is only an order, nothing but the gain is left.

    Raises:
        InputError: no linear model can be simulated over the records.
    """
    from bender_identify.first_model.fit import CANNOT_BE
    from bender_identify.first_model.linear_structures import linear_structures

    try:
        found = linear_structures(records, how.input_hold, AUTO, names)
    except CANNOT_BE as error:
        raise InputError(f"no linear model can be simulated over the records: {error}; check the units") from None
    linear = [x for x in found if not x.behind_a_loop]
    plain = [x for x in linear if not x.structure.delay and x.hidden_behind is None and x.rings]
    gain = next((_named(x) for x in plain if x.structure.order == 0), None)
    simple = [x for x in plain if 0 < x.structure.order <= MOST_ORDER and not (x.structure.lags and x.structure.modes)]
    looped = [x for x in found if x.behind_a_loop and x.rings][:1]
    # a search frees their numbers: with the same parts as behind a loop, it is that one again
    parts = [(x.structure.lags, x.structure.modes) for x in looped]
    simple = [x for x in simple if (x.structure.lags, x.structure.modes) not in parts]
    kinds = {bool(x.structure.modes): x for x in reversed(simple)}
    best = [*looped, *(x for x in simple if x in kinds.values())][:MOST_STRUCTURES]
    orders = [] if how.untimed else [_named(x) for x in best]
    # behind an even curve a linear fit sees nothing: the structure that it hides is one more
    hidden = [_named(x) for x in found if x.hidden_behind is not None][: 0 if how.untimed else 1]
    competing = [CompetingStructure(x) for x in (*orders, *([] if gain is None else [gain]))]
    competing += [CompetingStructure(x, hidden=True) for x in hidden]
    if not competing:
        raise InputError("no linear model follows the records; give one by --model")
    return competing


def _named(x: "LinearStructure") -> Model:
    """Return the model of a structure with a name that says which it is, as several compete."""
    beside = " behind a loop" if x.behind_a_loop else "" if x.hidden_behind is None else f" behind {x.hidden_behind}"
    return replace(x.model, name=f"{AUTO} {x.structure.name}{beside}")


def rebased(found: Searched, given: Model) -> tuple[Searched, Model]:
    """Return what was found with the linear structure that won as the model as given, and that model.

    Args:
        found: by a search in which structures competed.
        given: the one that its problem had.
    """
    chosen = found.best.hypothesis.structure
    if chosen is None:
        return found, given
    archive = found.archive
    moved = {}
    for x in archive.fits:
        own = x.hypothesis.structure
        structure = None if own is chosen else (own or given)
        moved[id(x)] = replace(x, hypothesis=replace(x.hypothesis, structure=structure))
    archive.rebase(replace(archive.problem, base=chosen), moved)
    base, best = (moved[id(x)] for x in (found.base, found.best))
    return replace(found, base=base, best=best), chosen
