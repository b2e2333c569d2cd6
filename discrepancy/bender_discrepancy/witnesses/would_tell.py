"""Columns that the records lack and that could distinguish what they leave open.

A profile of voltages separates rivals that differ in what the tip does. A lag before a nearly linear plant and one
behind it hardly do, whatever is played; what stands between the two, the supply's terminals, sees one of them only.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.fitting.criterion import CONFIDENCE
from bender_discrepancy.witnesses import terminals
from bender_discrepancy.witnesses.read_back import read_back
from bender_discrepancy.witnesses.testimony import DRIFT
from bender_discrepancy.witnesses.thermometer import WARM_K, course_of
from bender_loop.records.record import Record
from bender_report.wording import listed, lower_first, quantity

SUPPLY_VOLTAGE, TEMPERATURE = "supply_voltage_V", "temperature_C"


@dataclass(frozen=True, slots=True)
class Missing:
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


def would_tell(
    open_effects: Iterable[frozenset[str]], records: Sequence[Record], *, is_film: bool
) -> tuple[Missing, ...]:
    """Return the columns that could distinguish sets of effects where the records do not.

    Args:
        open_effects: the effects of each hypothesis; what all of them have is not in question.
        records: of one bench.
        is_film: the plant is a film, whose tip is known to move with the temperature.
    """
    sets = list(open_effects)
    supply = {x & set(terminals.EFFECTS) for x in sets}
    found: list[Missing] = []
    if len(supply) > 1 and all(read_back(x) is None for x in records):
        known = frozenset().union(*supply) - frozenset(terminals.EFFECTS).intersection(*supply)
        told = tuple(x for x in terminals.EFFECTS if x in known)
        found.append(Missing(SUPPLY_VOLTAGE, told, _of_supply(told)))
    if len({DRIFT in x for x in sets}) > 1 and any(course_of(x, CONFIDENCE) is None for x in records):
        found.append(Missing(TEMPERATURE, (DRIFT,), _of_warmth(is_film)))
    return tuple(found)


def _of_supply(told: Sequence[str]) -> str:
    both = [x for x in told if x in terminals.ONLY_BEFORE]
    before = [x for x in told if x not in terminals.ONLY_BEFORE]
    words = [f"show {_titles(both)}, or exclude all but what is small"] if both else []
    words += [f"show {_titles(before)} before the terminals"] if before else []
    return f"what the supply reads back beside each row (column {SUPPLY_VOLTAGE}) could {listed(words)}"


def _of_warmth(is_film: bool) -> str:
    kept = f"exclude {_titles((DRIFT,))} where it stays"
    could = f"show {_titles((DRIFT,))}, or {kept}" if is_film else f"{kept} within {quantity(WARM_K, 'K')}"
    return f"the temperature beside each row (column {TEMPERATURE}) could {could}"


def _titles(effects: Sequence[str]) -> str:
    return listed([lower_first(EFFECTS[x].title) for x in effects], "or")
