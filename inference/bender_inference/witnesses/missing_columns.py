"""Columns that the records lack and that could distinguish what they leave open.

A profile of voltages separates rivals that differ in what the tip does. A lag before a nearly linear plant and one
behind it hardly do, whatever is played; what stands between the two sees one of them only: the supply's terminals, or
the electrodes, which lie behind the resistance of the leads too.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from bender_effects.catalogue import EFFECTS
from bender_inference.fitting.criterion import CONFIDENCE
from bender_inference.witnesses.read_back import ELECTRODES, SUPPLY, read_back
from bender_inference.witnesses.terminals import BEFORE_ELECTRODES, BEFORE_TERMINALS, WITNESSED
from bender_inference.witnesses.testimony import WARMED
from bender_inference.witnesses.thermometer import WARM_K, course_of
from bender_loop.records.record import Record
from bender_report.wording import listed, lower_first, quantity

TEMPERATURE = "temperature_C"
IN_THE_LEADS = tuple(x for x in BEFORE_ELECTRODES if x not in BEFORE_TERMINALS)
"""Effects that lie before the electrodes, and perhaps behind the terminals."""


@dataclass(frozen=True, slots=True)
class MissingColumn:
    """A column that says something in no record.

    Attributes:
        column: its name in a record.
        tells: ids of the effects in question that it could show or exclude.
        why: what it could do, in a sentence.
    """

    column: str
    tells: tuple[str, ...]
    why: str

    def to_dict(self) -> dict[str, Any]:
        """Return its entry in `diagnosis.json`."""
        return {"column": self.column, "tells": list(self.tells), "why": self.why}


def missing_columns(
    open_effects: Iterable[frozenset[str]], records: Sequence[Record], *, is_film: bool
) -> tuple[MissingColumn, ...]:
    """Return the columns that could distinguish sets of effects where the records do not.

    Args:
        open_effects: the effects of each hypothesis; what all of them have is not in question.
        records: of one bench.
        is_film: the plant is a film, whose tip is known to move with the temperature.
    """
    sets = list(open_effects)
    supply = {x & set(WITNESSED) for x in sets}
    found: list[MissingColumn] = []
    lacking = [x for x in (SUPPLY, ELECTRODES) if all(read_back(one, column=x) is None for one in records)]
    if len(supply) > 1 and ELECTRODES in lacking:
        known = frozenset().union(*supply) - frozenset(WITNESSED).intersection(*supply)
        told = tuple(x for x in WITNESSED if x in known)
        if SUPPLY in lacking:
            found.append(MissingColumn(SUPPLY, told, _of_supply(told)))
        if lag := tuple(x for x in IN_THE_LEADS if x in told):
            found.append(MissingColumn(ELECTRODES, lag, _of_electrodes(lag)))
    if len({frozenset(x & set(WARMED)) for x in sets}) > 1 and any(course_of(x, CONFIDENCE) is None for x in records):
        found.append(MissingColumn(TEMPERATURE, WARMED, _of_warmth(is_film)))
    return tuple(found)


def _of_supply(told: Sequence[str]) -> str:
    both = [x for x in told if x in BEFORE_TERMINALS]
    before = [x for x in told if x not in BEFORE_TERMINALS]
    words = [f"show {_titles(both)}, or exclude all but what is small"] if both else []
    words += [f"show {_titles(before)} before the terminals"] if before else []
    return f"what the supply reads back beside each row (column {SUPPLY}) could {listed(words)}"


def _of_electrodes(lag: Sequence[str]) -> str:
    return (
        f"the voltage at the electrodes beside each row (column {ELECTRODES}) could show {_titles(lag)}, or exclude it"
    )


def _of_warmth(is_film: bool) -> str:
    kept = f"exclude {_titles(WARMED)} where it stays"
    could = f"show {_titles(WARMED)}, or {kept}" if is_film else f"{kept} within {quantity(WARM_K, 'K')}"
    return f"the temperature beside each row (column {TEMPERATURE}) could {could}"


def _titles(effects: Sequence[str]) -> str:
    return listed([lower_first(EFFECTS[x].title) for x in effects], "or")
