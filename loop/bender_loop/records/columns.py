"""Which columns of a table a record is made of: those that are named, of the usual names, or found."""

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, NamedTuple

from bender_loop.errors import InputError
from bender_loop.tables import units as unit_tables
from bender_loop.tables.column_choice import found_columns, positional, with_heading
from bender_loop.tables.table import ColumnTable, Table

if TYPE_CHECKING:
    from bender_loop.records.variables import Variable


class Column(NamedTuple):
    """One column: its name in a record, the units it may come in, whether it must be there and may have gaps."""

    field: str
    scales: dict[str, unit_tables.Scale]
    required: bool
    gaps: bool


COLUMNS: dict[str, Column] = {
    "time": Column("time_s", unit_tables.TIME_S, required=True, gaps=False),
    "voltage": Column("voltage_V", unit_tables.VOLTAGE_V, required=True, gaps=False),
    "displacement": Column("displacement_um", unit_tables.LENGTH_UM, required=True, gaps=True),
    "command_time": Column("command_time_s", unit_tables.TIME_S, required=False, gaps=False),
    "supply_voltage": Column("supply_voltage_V", unit_tables.VOLTAGE_V, required=False, gaps=True),
    "setpoint": Column("setpoint_um", unit_tables.LENGTH_UM, required=False, gaps=True),
    "current": Column("current_A", unit_tables.CURRENT_A, required=False, gaps=True),
    "temperature": Column("temperature_C", unit_tables.TEMPERATURE_C, required=False, gaps=True),
    "electrode_voltage": Column("electrode_voltage_V", unit_tables.VOLTAGE_V, required=False, gaps=True),
    "exposure": Column("exposure_s", unit_tables.TIME_S, required=False, gaps=False),
}


def column_names(columns: str | Mapping[str, str] | None) -> dict[str, str]:
    """Return the names of `--columns` by key.

    Raises:
        InputError: a key is not known or there twice, or the text is in no form of these.
    """
    if columns is None:
        return {}
    if isinstance(columns, str) and (named := positional(columns, list(COLUMNS))) is not None:
        return named
    pairs = list(columns.items()) if isinstance(columns, Mapping) else pairs_of("--columns", columns)
    for key, _ in pairs:
        known_key("--columns", key)
    if len({key for key, _ in pairs}) != len(pairs):
        raise InputError(f"--columns: found a column named twice in {columns!r}, expected each once")
    return dict(pairs)


def pairs_of(option: str, text: str) -> list[tuple[str, str]]:
    """Return the entries of `time=t,voltage=U`.

    Raises:
        InputError: an entry is of another form.
    """
    pairs = []
    for entry in text.split(","):
        key, equals, name = (part.strip() for part in entry.partition("="))
        if not (key and equals and name):
            raise InputError(f"{option}: found {entry.strip()!r}, expected entries like time=t with a comma between")
        pairs.append((key, name))
    return pairs


def known_key(option: str, key: str) -> str:
    """Return the key.

    Raises:
        InputError: there is no such column.
    """
    if key not in COLUMNS:
        raise InputError(f"{option}: found {key!r}, expected one of {', '.join(COLUMNS)}")
    return key


class Choice(NamedTuple):
    """The columns of a table that a record is made of.

    Attributes:
        names: by key; one that is not there has the usual name, or none.
        found: keys of those that neither an option nor the record's own names tell.
    """

    names: dict[str, str]
    found: frozenset[str]


def chosen_columns(
    table: Table | ColumnTable,
    columns: str | Mapping[str, str] | None,
    chosen: Mapping[str, str | None] | None = None,
    variables: "Mapping[str, Variable] | None" = None,
    others: Collection[str] = (),
) -> Choice:
    """Return the columns that are named; of the required ones that are not, those that say what they are.

    Args:
        table: with its header.
        columns: names that differ from the record's, as `read_record` takes them.
        chosen: columns of a plant's variables by key, in the place of those of the record.
        variables: a plant's variables by key; a column may bear their names.
        others: columns that are something else.

    Raises:
        InputError: `columns` cannot be read.
    """
    header = table.header
    told = column_names(columns)
    names = {key: with_heading(name, header) for key, name in told.items()}
    names |= {key: with_heading(name, header) for key, name in (chosen or {}).items() if name is not None}
    names |= {
        key: heading
        for key, variable in (variables or {}).items()
        if key not in names
        and COLUMNS[key].field not in header
        and (heading := with_heading(variable.name, header)) in header
    }
    own = {key: x.field for key, x in COLUMNS.items() if x.field in header and key not in names}
    elsewhere = {with_heading(x, header) for x in others}
    free = [k for k, name in enumerate(header) if name not in {*own.values(), *elsewhere, *names.values()}]
    found = found_columns(
        [header[k] for k in free], [table.units[k] for k in free] if table.units else (), {*own, *names}, set(told)
    )
    return Choice(names | found, frozenset(found))


_WORDS = {"time": "time", "voltage": "input", "displacement": "reading"}


def missing_columns(
    table: Table | ColumnTable, names: Mapping[str, str], variables: "Mapping[str, Variable]"
) -> InputError | None:
    """Return what is said of all columns that are named or required and not there, None where there is none."""
    wrong = [name for name in names.values() if name not in table]
    lacking = [key for key, x in COLUMNS.items() if x.required and key not in names and x.field not in table]
    sought = [
        f"{COLUMNS[key].field} or {variables[key].name}" if key in variables else COLUMNS[key].field for key in lacking
    ]
    missing = [*wrong, *sought]
    if not missing:
        return None
    said = (
        f"column {missing[0]}: no such column"
        if len(missing) == 1
        else f"columns {', '.join(missing)}: no such columns"
    )
    said = f"{table.heading}, {said}; {unit_tables.near(missing[0], table.header)}"
    if not lacking:
        return InputError(said)
    words = ", ".join(_WORDS[key] for key in lacking)
    verb = "has another name" if len(lacking) == 1 else "have other names"
    hint = table.column_hint.format("=NAME,".join(lacking))
    return InputError(f"{said}; if {words} {verb}: {hint}")
