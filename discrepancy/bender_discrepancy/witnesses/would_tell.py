"""Columns that the records lack and that would tell apart what they leave open.

A profile of voltages separates rivals that differ in what the tip does. A lag before a nearly linear plant and one
behind it hardly do, whatever is played; what stands between the two, the supply's terminals, sees one of them only.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.witnesses import terminals
from bender_discrepancy.witnesses.testimony import DRIFT
from bender_loop.records.record import Record
from bender_report.wording import listed, lower_first

SUPPLY_VOLTAGE, TEMPERATURE = "supply_voltage_V", "temperature_C"


@dataclass(frozen=True, slots=True)
class Missing:
    """A column that no record has, or not every one.

    Attributes:
        column: its name in a record.
        shows: ids of the effects in question that it would show.
        why: what it does, in a sentence.
    """

    column: str
    shows: tuple[str, ...]
    why: str

    def to_dict(self) -> dict[str, Any]:
        """Return its entry in `diagnosis.json`."""
        return {"column": self.column, "shows": list(self.shows), "why": self.why}


def would_tell(open_effects: Iterable[frozenset[str]], records: Sequence[Record]) -> tuple[Missing, ...]:
    """Return the columns that would tell apart sets of effects which the records cannot distinguish.

    Args:
        open_effects: the effects of each hypothesis; what all of them have is not in question.
        records: of one bench.
    """
    sets = list(open_effects)
    in_question = frozenset().union(*sets) - frozenset(EFFECTS).intersection(*sets)
    supply = {x & in_question & set(terminals.EFFECTS) for x in sets}
    warm = {DRIFT in x for x in sets}
    found: list[Missing] = []
    if len(supply) > 1 and any(x.supply_voltage_V is None for x in records):
        shown = tuple(x for x in terminals.EFFECTS if x in frozenset().union(*supply))
        found.append(Missing(SUPPLY_VOLTAGE, shown, _of_supply(shown)))
    if len(warm) > 1 and any(x.temperature_C is None for x in records):
        why = f"the temperature beside each row (column {TEMPERATURE}) would show or exclude {_titles((DRIFT,))}"
        found.append(Missing(TEMPERATURE, (DRIFT,), why))
    return tuple(found)


def _of_supply(shown: Sequence[str]) -> str:
    sure = [x for x in shown if x in terminals.ONLY_BEFORE]
    unsure = [x for x in shown if x not in terminals.ONLY_BEFORE]
    told = [f"show or exclude {_titles(sure)}"] if sure else []
    told += [f"show {_titles(unsure)} before the terminals"] if unsure else []
    return f"what the supply reads back beside each row (column {SUPPLY_VOLTAGE}) would {listed(told)}"


def _titles(effects: Sequence[str]) -> str:
    return listed([lower_first(EFFECTS[x].title) for x in effects], "or")
