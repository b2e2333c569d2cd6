"""Records: of a file, a DataFrame or arrays."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_loop.errors import InputError
from bender_loop.records.record import Record, read_record, record_from_columns, write_record
from bender_loop.shell.files import prepare_directory
from bender_report.palette import light
from bender_report.wording import unit_text
from piezo_bender.shared import axes_or_new, frame_of, is_table, kind_of, name_arguments_in_errors, require_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

    from bender_loop.records.variables import Variable


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LoadedRecord:
    """What was commanded and what was read, with the name of where it comes from.

    Attributes:
        record: the columns, read-only.
        source: its file, or a name.
    """

    record: Record
    source: str

    @property
    def time_s(self) -> NDArray[np.float64]:
        """(n,) instants of the readings."""
        return self.record.time_s

    @property
    def voltage_V(self) -> NDArray[np.float64]:
        """(n,) commands."""
        return self.record.voltage_V

    @property
    def displacement_um(self) -> NDArray[np.float64]:
        """(n,) readings, NaN where a frame was lost."""
        return self.record.displacement_um

    @property
    def name(self) -> str:
        """The file's name without its folder and ending."""
        return Path(self.source).stem

    def __len__(self) -> int:
        return len(self.record)

    def save(self, folder: Path | str) -> Path:
        """Write the record as CSV into a directory; return the directory.

        Raises:
            InputError: it cannot be written.
        """
        out = prepare_directory(Path(folder))
        write_record(out / f"{self.name}.csv", self.record)
        return out

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the readings over time; return the axes drawn into."""
        drawn = axes_or_new(axes)
        drawn.plot(self.time_s, self.displacement_um, ".", ms=2.5, color=light("measured"))
        reading = unit_text(self.record.quantities.reading)
        drawn.set(xlabel="time (s)", ylabel=f"reading ({reading})", title=self.name)
        return drawn

    def to_dict(self) -> dict[str, Any]:
        """Return the columns as lists, a lost reading as None."""
        columns = self.record.columns()
        return {k: [x if np.isfinite(x) else None for x in values.tolist()] for k, values in columns.items()}

    def to_frame(self) -> "DataFrame":
        """Return the columns as a DataFrame, further inputs among them (needs pandas)."""
        return frame_of({**self.record.columns(), **{x.name: x.values for x in self.record.further}})

    def __repr__(self) -> str:
        unit = unit_text(self.record.quantities.command)
        volts = f"{np.min(self.voltage_V):g} to {np.max(self.voltage_V):g} {unit}"
        return f"<LoadedRecord {self.name}: {len(self)} rows in {np.ptp(self.time_s):.4g} s, {volts}>"

    def _repr_html_(self) -> str:
        return f"<p>{self.__repr__().strip('<>')}</p>"


Source: TypeAlias = "str | Path | Record | LoadedRecord | Mapping[str, ArrayLike] | DataFrame"
"""What a record is loaded from."""


@name_arguments_in_errors
def load_record(
    source: "Source | None" = None,
    columns: str | Mapping[str, str] | None = None,
    units: str | None = None,
    *,
    name: str = "record",
    further: Mapping[str, str] | None = None,
    reading: str | None = None,
    variables: "Mapping[str, Variable] | None" = None,
    **arrays: ArrayLike,
) -> LoadedRecord:
    """Load a record from a CSV file, a DataFrame, a mapping of columns, or arrays.

    Args:
        source: a path, a DataFrame or a mapping with the columns time_s, voltage_V and displacement_um, or with usual
            heads (`t`, `Spannung [V]`, `position (mm)`); dates count from the first row; None where
            the arrays are given by name.
        columns: other names of the columns, as "time=t,voltage=U,displacement=d" or a mapping.
        units: of the columns, as "ms,V,mm".
        name: what a record that comes from no file is called in messages and results.
        further: inputs of an FMU beside the command, and the columns that they follow.
        reading: the column that was read, where it is not the displacement: of one output of several.
        variables: input and output of an FMU by the keys "voltage" and "displacement", whose columns bear their names.
        **arrays: time_s, voltage_V, displacement_um and the optional columns of a record, each (n,).

    Raises:
        InputError: naming the file or record, the row, the column, what was found and what was expected.
    """
    _check_words(columns, units)
    if source is not None and arrays:
        raise InputError(
            f"{', '.join(arrays)}: no such argument of load_record beside a source, expected columns, units, name, "
            "further, reading or variables"
        )
    if source is None and not arrays:
        raise InputError("load_record: expected a path, a table, or the arrays time_s, voltage_V and displacement_um")
    if isinstance(source, LoadedRecord | Record):
        loaded = source if isinstance(source, LoadedRecord) else LoadedRecord(source, name)
        if reading is not None or set(further or {}) - {x.name for x in loaded.record.further}:
            raise InputError(
                f"{loaded.source}: found a loaded record, expected the path or the table itself: --further-input and "
                "--reading name columns of it"
            )
        return loaded
    if isinstance(source, str | Path):
        record = read_record(Path(source), columns, units, reading=reading, further=further, variables=variables)
        return LoadedRecord(record, str(source))
    given: Any = arrays if source is None else source
    if not is_table(given):
        raise InputError(f"{name}: found {kind_of(given)}, expected a path, a DataFrame or named columns")
    heads = given.keys() if isinstance(given, Mapping) else given.columns
    return LoadedRecord(
        record_from_columns(
            {str(key): _in_seconds(name, str(key), given[key], units) for key in heads},
            name,
            columns,
            units,
            further,
            reading,
            variables,
        ),
        name,
    )


def _check_words(columns: object, units: object) -> None:
    if not isinstance(columns, str | Mapping | None):
        raise InputError(
            f"columns: found {kind_of(columns)}, expected text such as 'time=t,voltage=U,displacement=d', or a dict"
        )
    require_text("units", units, "ms,V,mm")


def _in_seconds(name: str, column: str, values: Any, units: str | None) -> Any:
    """Return dates and times as seconds from the first row, spans of time as seconds, anything else as it is."""
    found = np.asarray(values)
    if found.ndim != 1 or not found.size:
        return values
    if found.dtype.kind == "O" and isinstance(found[0], datetime | timedelta):
        first = found[0]
        since = [x - first for x in found] if isinstance(first, datetime) else found
        spans = np.array([x.total_seconds() for x in since])
    elif found.dtype.kind in "Mm":
        spans = (found - found[0] if found.dtype.kind == "M" else found) / np.timedelta64(1, "s")
    else:
        return values
    if units is not None and "s" not in [x.rpartition("=")[2].strip() for x in units.split(",")]:
        raise InputError(f"{name}, column {column}: found dates or spans of time and the units {units!r}, expected s")
    return spans


def several(
    records: Any,
    columns: str | Mapping[str, str] | None,
    units: str | None,
    further: Mapping[str, str] | None = None,
    reading: str | None = None,
    variables: "Mapping[str, Variable] | None" = None,
) -> list[LoadedRecord]:
    """Return one record, or a list, tuple or generator of them, as a list.

    Raises:
        InputError: one cannot be read, or there is none.
    """
    given = list(records) if isinstance(records, list | tuple | Iterator) else [records]
    if not given:
        raise InputError("no record was given, expected at least one")
    many = len(given) > 1
    names = [f"record {k + 1}" if many else "record" for k in range(len(given))]
    more: dict[str, Any] = {"further": further, "reading": reading, "variables": variables}
    return [load_record(x, columns, units, name=name, **more) for x, name in zip(given, names, strict=True)]
