"""Records: what was commanded and what was read, row by row.

Row k: the displacement was read at `time_s[k]`, before `voltage_V[k]` acts; that voltage then holds until the next
row. Where `command_time_s` is given, the voltage acts from then.
"""

import io
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_loop.errors import InputError
from bender_loop.records.columns import (
    COLUMNS,
    Choice,
    Column,
    chosen_columns,
    column_names,
    known_key,
    missing_columns,
    pairs_of,
)
from bender_loop.records.further import Further
from bender_loop.shell.files import write_atomically
from bender_loop.tables import units as unit_tables
from bender_loop.tables.column_choice import with_heading
from bender_loop.tables.quantities import MICROMETRE, USUAL, VOLT, Quantities, compact, factor, is_known
from bender_loop.tables.table import PLAIN, ColumnTable, Table, read_any_table
from bender_loop.tables.text_blocks import Progress
from bender_loop.tables.text_layout import TextLayout, unit_in_heading

if TYPE_CHECKING:
    from bender_loop.records.variables import Variable

Array = NDArray[np.float64]


_ROWS_AT_A_TIME = 1 << 16
_EVEN = 1.5
"""Times the median: steps of a column of times stay below."""
_GAPS = {column.field: column.gaps for column in COLUMNS.values()}


class _Fault(NamedTuple):
    row: int
    column: str
    found: str
    expected: str


@dataclass(frozen=True, slots=True)
class ZeroMove:
    """From a row on, a sensor reads more, whatever it reads.

    Attributes:
        row: the first, from 0.
        height_um: by how much, in the record's unit of the reading.
    """

    row: int
    height_um: float


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """Columns of equal length (n,), n >= 2, kept as read-only copies.

    Attributes:
        time_s: when the displacement was read; finite, strictly increasing, steps may be uneven.
        voltage_V: what was commanded at that row; finite.
        displacement_um: what was read; NaN is a lost frame.
        command_time_s: when the voltage began to act, from time_s[k] to time_s[k+1]; None for time_s itself.
        supply_voltage_V: read back from the supply, NaN where lost; None where not recorded, as those below.
        setpoint_um: what the controller aimed at.
        current_A: drawn from the supply.
        temperature_C: of the surroundings.
        electrode_voltage_V: measured at the electrodes of the actuator, behind its leads.
        exposure_s: a frame shows the mean over this time, whose middle is time_s; the same in every row.
        quantities: units of `voltage_V` and `displacement_um`; of another rig they are not V and um but those here.
        further: what acts on the plant beside the command, row by row; they are not written to a file.
        zero_move: of the sensor, already taken from `displacement_um`; None where there was none.
        made_up: (n,) rows that the file lacks, see `missing_rows`; None for none.
        repeats: readings that were lost as repeated ones, see `repeated_readings`.
        behind_pauses: readings that were lost behind pauses, see `missing_rows`.
        pauses: first rows behind pauses in which nobody knows the command.

    Raises:
        ValueError: a column breaks its rule; the message names row (from 0), column, found and expected.
    """

    time_s: Array
    voltage_V: Array
    displacement_um: Array
    command_time_s: Array | None = None
    supply_voltage_V: Array | None = None
    setpoint_um: Array | None = None
    current_A: Array | None = None
    temperature_C: Array | None = None
    electrode_voltage_V: Array | None = None
    exposure_s: Array | None = None
    quantities: Quantities = USUAL
    further: tuple[Further, ...] = ()
    zero_move: ZeroMove | None = None
    made_up: NDArray[np.bool_] | None = None
    repeats: int = 0
    behind_pauses: int = 0
    pauses: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        for name, values in self.columns().items():
            object.__setattr__(self, name, _read_only(name, values))
        columns = self.columns() | {x.name: x.values for x in self.further}
        lengths = {name: len(values) for name, values in columns.items()}
        if len(set(lengths.values())) != 1:
            raise ValueError(f"columns must have equal lengths, found {lengths}")
        if len(self) < 2:
            raise ValueError(f"a record needs at least 2 rows, found {len(self)}")
        fault = _first_fault(columns)
        if fault is not None:
            raise ValueError(f"row {fault.row}, column {fault.column}: found {fault.found}, expected {fault.expected}")

    @property
    def exposure(self) -> float:
        """The exposure of every frame in s; 0 where readings are snapshots."""
        return 0.0 if self.exposure_s is None else float(self.exposure_s[0])

    def __len__(self) -> int:
        return len(self.time_s)

    def columns(self) -> dict[str, Array]:
        """The columns that are there, by their names in a file."""
        beside = ("quantities", "further", "zero_move", "made_up", "repeats", "behind_pauses", "pauses")
        present = ((field.name, getattr(self, field.name)) for field in fields(self) if field.name not in beside)
        return {name: values for name, values in present if values is not None}


def read_record(
    path: Path,
    columns: str | Mapping[str, str] | None = None,
    units: str | None = None,
    layout: TextLayout = PLAIN,
    tell: Callable[[str], None] | None = None,
    progress: Progress | None = None,
    reading: str | None = None,
    further: Mapping[str, str] | None = None,
    variables: "Mapping[str, Variable] | None" = None,
    command: str | None = None,
    unread: Mapping[str, str] | None = None,
) -> Record:
    """Read a record from a file.

    Args:
        path: CSV with one header line, comma, point as the decimal sign; a text file in another layout; `.parquet`,
            `.mat`, `.h5`, `.npz`, `.tdms`. Other columns are ignored.
        columns: names that differ from the record's, as "time=t,voltage=U,displacement=d", as "t,U,d" in that order,
            or as a mapping; the keys are those of `COLUMNS`. A number is the place of a column, from 1.
        units: units of the columns in the order in which `columns` names them, as "ms,V,mm" (without `columns`:
            of time, voltage and displacement), or by key, as "time=ms".
        layout: how a text file is read; what is not given is found.
        tell: is told in one line how a file was read that is not in the form of a record.
        progress: is told how many blocks of how many of a column are read.
        reading: the column that was read, in the place of the displacement; its heading may say its unit.
        further: columns of what acts on the plant beside the command, by the names of its inputs.
        variables: a plant's input and output by the keys "voltage" and "displacement": a column of such a name
            is taken where there is none of the record's own name and `columns` names no other.
        command: the column that was commanded, in the place of the voltage; its heading may say its unit.
        unread: by names that columns may have, what is told where one of them is there and nothing reads it.

    Raises:
        InputError: naming the file, the line, the column, what was found and what was expected.
    """
    names = column_names(columns)
    scales = _column_scales(units, list(names) or ["time", "voltage", "displacement"])
    usual = [column.field for column in COLUMNS.values()]
    beside = dict(further or {})
    wanted = [*names.values(), *usual, *beside.values(), *(x for x in (reading, command) if x)]
    table = read_any_table(path, layout, wanted, progress)
    choice = chosen_columns(table, columns, {"voltage": command, "displacement": reading}, variables, beside.values())
    record = _record_of(table, choice, scales, tell, variables or {})
    if tell is not None:
        read = {*choice.names.values(), *usual, *beside.values()}
        for name, sentence in (unread or {}).items():
            heading = with_heading(name, table.header)
            if heading in table and heading not in read:
                tell(sentence)
    return replace(record, further=tuple(_further(table, *x) for x in beside.items())) if beside else record


def _further(table: Table | ColumnTable, name: str, column: str) -> Further:
    heading = with_heading(column, table.header)
    if heading not in table:
        others = unit_tables.near(column, table.header)
        raise InputError(f"{table.heading}, column {column}: no such column; {others}; --further-input {name}=COLUMN")
    unit = table.units[table.header.index(heading)] if table.units else unit_in_heading(heading)
    return Further(name, unit or "", _read_only(heading, table.numbers(heading, gaps=False)))


def record_from_columns(
    given: Mapping[str, ArrayLike],
    name: str,
    columns: str | Mapping[str, str] | None = None,
    units: str | None = None,
    further: Mapping[str, str] | None = None,
    reading: str | None = None,
    variables: "Mapping[str, Variable] | None" = None,
) -> Record:
    """Make a record of named columns, as a DataFrame has them.

    Args:
        given: column names and values, each (n,).
        name: of the table, for messages.
        columns: names that differ from the record's, see `read_record`.
        units: of the columns, see `read_record`.
        further: columns of what acts on the plant beside the command, by the names of its inputs.
        reading: the column that was read, in the place of the displacement; its heading may say its unit.
        variables: a plant's input and output, see `read_record`.

    Raises:
        InputError: naming the table, the row (from 0), the column, what was found and what was expected.
    """
    names = column_names(columns)
    scales = _column_scales(units, list(names) or ["time", "voltage", "displacement"])
    table = ColumnTable(name, given)
    choice = chosen_columns(table, columns, {"displacement": reading}, variables, (further or {}).values())
    record = _record_of(table, choice, scales, None, variables or {})
    beside = tuple(_further(table, *x) for x in (further or {}).items())
    return replace(record, further=beside) if beside else record


class Origin(NamedTuple):
    """Where a column of a record comes from: its name in the table, and its scale, or its unit as it is written.

    `is_stated`: whether anything says the unit.
    """

    name: str
    scale: unit_tables.Scale | str
    is_stated: bool = True


def origins_in(table: Table, columns: str | None, units: str | None) -> dict[str, Origin]:
    """Return where the columns of a record stand in a table, by key; its rows are not looked at.

    Args:
        table: with its header.
        columns: names that differ from the record's, see `read_record`.
        units: of the columns, see `read_record`.

    Raises:
        InputError: a column is missing, or an option or a unit is not known.
    """
    names = column_names(columns)
    scales = _column_scales(units, list(names) or ["time", "voltage", "displacement"])
    return dict(_origins(table, chosen_columns(table, columns).names, scales, {}))


def checked_options(columns: str | None, units: str | None) -> None:
    """Refuse what `columns` and `units` of `read_record` cannot be, before any table is read.

    Raises:
        InputError: a key or a unit is not known.
    """
    _column_scales(units, list(column_names(columns)) or ["time", "voltage", "displacement"])


def _origins(
    table: Table | ColumnTable,
    names: Mapping[str, str],
    scales: Mapping[str, unit_tables.Scale | str],
    variables: "Mapping[str, Variable]",
) -> Iterator[tuple[str, Origin]]:
    if (missing := missing_columns(table, names, variables)) is not None:
        raise missing
    for key, column in COLUMNS.items():
        name = names.get(key, column.field)
        if key not in names and name not in table:
            continue
        told = scales.get(key)
        if not told and name in table:
            told = _scale_in_file(table, name, column, key)
        if not told and key in variables:
            told = _unit_of_variable(column, key, variables[key])
        yield key, Origin(name, told or (1.0, 1.0), bool(told))


def _record_of(
    table: Table | ColumnTable,
    choice: Choice,
    scales: Mapping[str, unit_tables.Scale | str],
    tell: Callable[[str], None] | None,
    variables: "Mapping[str, Variable]",
) -> Record:
    values: dict[str, Array] = {}
    sources: dict[str, str] = {}
    own: dict[str, str] = {}
    stated: dict[str, str] = {}
    unstated: dict[str, str] = {}
    for key, (name, scale, is_stated) in _origins(table, choice.names, scales, variables):
        column = COLUMNS[key]
        numbers = table.numbers(name, gaps=column.gaps)
        if isinstance(scale, str):
            stated[key] = scale
            times, own[key] = compact(scale, float(np.nanmax(np.abs(numbers), initial=0.0)))
            scale = (times, 1.0) if times >= 1.0 else (1.0, round(1.0 / times))
        else:
            stated[key] = next((unit for unit, x in column.scales.items() if x == scale), "")
            if not is_stated and not (key == "displacement" and key in variables and not variables[key].unit):
                unstated[name] = stated[key].replace("um", "µm")
        multiplier, divisor = scale
        with np.errstate(all="ignore"):  # what is no finite number then is named below
            values[column.field] = numbers * multiplier / divisor
        sources[column.field] = name
    if len(table) < 2:
        raise InputError(
            f"{table.path}: found {len(table)} {'row' if len(table) == 1 else 'rows'} below the header, expected at "
            "least 2; a diagnosis or a first model needs 40"
        )
    fault = _first_fault(values)
    if fault is not None:
        if fault.column == "time_s" and fault.row and np.all(np.isfinite(values["time_s"])):
            raise _backwards(table, fault.row, sources, stated["time"], values)
        raise table.fault(fault.row, sources[fault.column], fault.found, fault.expected)
    if tell is not None:
        for line in [*_told(table, choice.found, sources, own), *_doubts(table, unstated, stated)]:
            tell(line)
    said = (stated.get("voltage", ""), stated.get("displacement", ""))
    quantities = Quantities(own.get("voltage", VOLT), own.get("displacement", MICROMETRE), said)
    columns: dict[str, Any] = values
    return Record(**columns, quantities=quantities)


def _told(
    table: Table | ColumnTable, found: Collection[str], sources: Mapping[str, str], own: Mapping[str, str]
) -> Iterator[str]:
    """Return how a table was read that is not in the form of a record, and which of its columns were found."""
    words = {
        "voltage_V": own.get("voltage") and "input",
        "displacement_um": own.get("displacement") and "reading",
    }
    if table.told or found:
        pairs = ", ".join(f"{words.get(field) or field} from {name!r}" for field, name in sources.items())
        yield f"{table.path}: " + (f"read with {table.told}; {pairs}" if table.told else pairs)


def _backwards(
    table: Table | ColumnTable, row: int, sources: Mapping[str, str], unit: str, values: Mapping[str, Array]
) -> InputError:
    """Return what is said where time does not rise, in the unit of the file."""
    name, command = sources["time_s"], sources["voltage_V"]
    before, here = (float(x) for x in table.numbers(name)[row - 1 : row + 1])
    steps = np.diff(values["voltage_V"])
    if np.all(steps > 0.0) and float(steps.max()) < _EVEN * float(np.median(steps)):
        advice = f"{command} rises evenly: if the columns are swapped, --columns time={command},voltage={name}"
    elif here == before:
        advice = "keep one row of each time"
    else:
        advice = "sort the rows by time, or make a record of each part where it starts anew"
    return table.fault(row, name, f"{here!r} {unit}", f"more than {before!r} {unit} of the row before; {advice}")


def _doubts(table: Table | ColumnTable, unstated: Mapping[str, str], stated: Mapping[str, str]) -> Iterator[str]:
    """Return what is said of units that nobody names, by heading what they are taken as, and of unknown ones."""
    if unstated:
        names, units = ", ".join(map(repr, unstated)), ", ".join(unstated.values())
        yield f"{table.path}: no unit found in {names}, taken as {units} (--units says it)"
    for key in ("voltage", "displacement"):
        unit = stated.get(key, "")
        if unit not in ("", "-") and unit_tables.find(COLUMNS[key].scales, unit) is None and not is_known(unit):
            yield f"{table.path}: {unit!r} is no known unit; the numbers stay as they are, and are called so"


def _scale_in_file(table: Table | ColumnTable, name: str, column: Column, key: str) -> unit_tables.Scale | str | None:
    """Return the scale of the unit that the file names for a column, None where it names none.

    Raises:
        InputError: the unit is none of such a column.
    """
    unit = table.units[table.header.index(name)] if table.units else unit_in_heading(name)
    if not unit:
        return unit_tables.find(column.scales, re.split(r"[\s_]", name.strip())[-1])
    scale = _scale_of(column, key, unit)
    if scale is None:
        units = ", ".join(column.scales)
        raise InputError(
            f"{table.heading}, column {name}: found the unit {unit!r}, expected one of {units}; --units names it"
        )
    return scale


def _unit_of_variable(column: Column, key: str, variable: "Variable") -> str | None:
    """Return the unit of a plant's variable where it is of another quantity than a record usually has."""
    found = _scale_of(column, key, variable.unit) if variable.unit else None
    return found if isinstance(found, str) else None


def _scale_of(column: Column, key: str, unit: str) -> unit_tables.Scale | str | None:
    """Return the scale of a unit, None where there is none; for command and reading any other unit as it is written."""
    found = unit_tables.find(column.scales, unit)
    if found is not None or key not in ("voltage", "displacement"):
        return found or _factor_of_time(column, unit)
    if not is_known(unit):
        return unit.strip() or None
    try:
        return factor(unit, VOLT if key == "voltage" else MICROMETRE), 1.0
    except InputError:
        return unit.strip()


def _factor_of_time(column: Column, unit: str) -> unit_tables.Scale | None:
    """Return the scale of a unit of time that is written in another way: sec, seconds, minutes."""
    try:
        return (factor(unit, "s"), 1.0) if column.scales is unit_tables.TIME_S else None
    except InputError:
        return None


def write_record(path: Path, record: Record) -> None:
    """Write `record` as CSV, whole or not at all; reading it back gives the same bits. A lost value is `nan`.

    Raises:
        InputError: the file cannot be written.
    """
    columns = record.columns()
    text = io.StringIO()
    text.write(",".join(columns) + "\n")
    for begin in range(0, len(record), _ROWS_AT_A_TIME):
        part = [values[begin : begin + _ROWS_AT_A_TIME].tolist() for values in columns.values()]
        text.writelines(",".join(map(repr, row)) + "\n" for row in zip(*part, strict=True))
    write_atomically(path, text.getvalue())


def _read_only(name: str, values: ArrayLike) -> Array:
    copy = np.array(values, dtype=np.float64)
    if copy.ndim != 1:
        raise ValueError(f"{name} must be one-dimensional, found shape {copy.shape}")
    copy.flags.writeable = False
    return copy


def _first_fault(columns: Mapping[str, Array]) -> _Fault | None:
    for name, values in columns.items():
        wrong = np.flatnonzero(np.isinf(values) if _GAPS.get(name, False) else ~np.isfinite(values))
        if len(wrong):
            return _Fault(int(wrong[0]), name, repr(float(values[wrong[0]])), "a finite number")
    time = columns["time_s"]
    falling = np.flatnonzero(time[1:] <= time[:-1])
    if len(falling):
        row = int(falling[0]) + 1
        return _Fault(row, "time_s", _seconds(time[row]), f"more than {_seconds(time[row - 1])} of the row before")
    return _command_time_fault(time, columns.get("command_time_s")) or _exposure_fault(time, columns.get("exposure_s"))


def _exposure_fault(time: Array, exposure: Array | None) -> _Fault | None:
    if exposure is None:
        return None
    longest = float(time[-1] - time[0])
    wrong = np.flatnonzero((exposure < 0.0) | (exposure > longest) | (exposure != exposure[0]))
    if not len(wrong):
        return None
    row = int(wrong[0])
    expected = f"{_seconds(exposure[0])} as in the first row" if row else f"0 to {_seconds(longest)}, the whole record"
    return _Fault(row, "exposure_s", _seconds(exposure[row]), expected)


def _command_time_fault(time: Array, command_time: Array | None) -> _Fault | None:
    if command_time is None:
        return None
    following = np.append(time[1:], np.inf)
    wrong = np.flatnonzero((command_time < time) | (command_time > following))
    if not len(wrong):
        return None
    row = int(wrong[0])
    expected = f"at least {_seconds(time[row])}, when its row was read"
    if command_time[row] > following[row]:
        expected = f"at most {_seconds(following[row])}, when the next row was read"
    return _Fault(row, "command_time_s", _seconds(command_time[row]), expected)


def _seconds(value: float) -> str:
    return f"{float(value)!r} s"


def _column_scales(units: str | None, order: list[str]) -> dict[str, unit_tables.Scale | str]:
    if units is None:
        return {}
    if "=" in units:
        pairs = pairs_of("--units", units)
    else:
        entries = [entry.strip() for entry in units.split(",")]
        if len(entries) != len(order):
            raise InputError(f"--units: found {len(entries)} in {units!r}, expected {len(order)} ({', '.join(order)})")
        pairs = list(zip(order, entries, strict=True))
    scales = {}
    for key, unit in pairs:
        column = COLUMNS[known_key("--units", key)]
        scale = _scale_of(column, key, unit)
        if scale is None:
            others = ", or of another quantity, as bar or mm/s" if key in ("voltage", "displacement") else ""
            raise InputError(f"--units: found {unit!r} for {key}, expected one of {', '.join(column.scales)}{others}")
        scales[key] = scale
    return scales
