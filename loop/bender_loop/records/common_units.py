"""Records that go together, with each other or with a model, in the same units."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from bender_loop.errors import InputError
from bender_loop.records.record import Array, Record
from bender_loop.tables.quantities import MICROMETRE, USUAL, VOLT, Quantities, factor

Units = tuple[str, str]
"""Of commands and of readings."""


def in_units_of(records: Sequence[Record], wanted: Units | None = None, names: Sequence[str] = ()) -> list[Record]:
    """Return records of one rig in the same units.

    Args:
        records: of one rig.
        wanted: units that a model states, empty for one that it does not; None without such a model. What is not said
            is, of the units in which the records are kept, that of the record with the largest numbers.
        names: of the records, for messages.

    Raises:
        InputError: they are of different quantities.
    """
    given: Units = wanted or ("", "")
    told = tuple(names) or tuple(f"record {k + 1}" for k in range(len(records)))
    needed = "the model" if wanted else told[0]
    command = given[0] or _of_the_largest([x.quantities.command for x in records], [x.voltage_V for x in records])
    reading = given[1] or _of_the_largest([x.quantities.reading for x in records], [x.displacement_um for x in records])
    return [_converted(x, (command, reading), name, needed) for x, name in zip(records, told, strict=True)]


def with_stated_unit(record: Record, value: float, unit: str, digits: int = 4) -> str:
    """Return a number of a record in the unit that its file states.

    Args:
        record: what it belongs to.
        value: in the unit in which the record is kept.
        unit: VOLT for a command, MICROMETRE for a reading.
        digits: that are shown.
    """
    place = (VOLT, MICROMETRE).index(unit)
    kept, stated = record.quantities[:2][place], record.quantities.stated[place]
    with suppress(InputError):  # what nobody can convert is told as it is kept
        value, kept = (value * factor(kept, stated), stated) if stated else (value, kept)
    return f"{value:.{digits}g} {'µm' if kept == MICROMETRE else kept}"


def _of_the_largest(units: Sequence[str], columns: Sequence[Array]) -> str:
    """Return the unit of the column that reaches farthest; the first one where they cannot be compared."""
    sizes = []
    for unit, values in zip(units, columns, strict=True):
        try:
            sizes.append(factor(unit, units[0]) * float(np.nanmax(np.abs(values), initial=0.0)))
        except InputError:
            return units[0]
    return units[int(np.argmax(sizes))]


def driven_in(own: Quantities, model: Units | None) -> Quantities:
    """Return the units in which the FMU of a model takes the commands of a record and gives its readings.

    They are those of the record where the FMU says that it stands for such a quantity, else V and um, each of which is
    1 of the unit of the record.

    Args:
        own: units of the record.
        model: units that the model states; None where it states none.
    """
    sides = zip(own[:2], model or USUAL[:2], USUAL[:2], strict=True)
    command, reading = (usual if stated in ("", usual) else unit for unit, stated, usual in sides)
    return Quantities(command, reading, own.stated)


def _converted(record: Record, wanted: Units, name: str, needed: str) -> Record:
    own = record.quantities
    if own[:2] == wanted:
        return record
    command, voltage = _brought(own, wanted, 0, name, needed)
    reading, displacement = _brought(own, wanted, 1, name, needed)
    return replace(
        record,
        voltage_V=voltage * record.voltage_V,
        displacement_um=displacement * record.displacement_um,
        quantities=Quantities(command, reading, own.stated),
    )


def _brought(own: Quantities, wanted: Units, side: int, name: str, needed: str) -> tuple[str, float]:
    """Return the unit of commands (side 0) or readings (1) as they are wanted, and the factor to it."""
    unit, usual = own[:2][side], USUAL[:2][side]
    try:
        return wanted[side], factor(unit, wanted[side])
    except InputError as problem:
        # a column, or a model, that states no unit is in V or um: it is in that of the other
        if unit == usual and own.stated[side] in ("", usual):
            return wanted[side], 1.0
        if wanted[side] == usual:
            return unit, 1.0
        what = ("commands", "readings")[side]
        raise InputError(
            f"{name}: found {what} in {own.stated[side] or unit}, expected {wanted[side]} as {needed} has them, or a "
            f"unit that can be converted to it ({problem}); say what the columns have, as in --units ms,V,rpm"
        ) from None
