"""Tables that name units and their records: CSV or Parquet with the columns `unit` and `record`."""

import csv
import io
from collections.abc import Iterator, Mapping
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple

from bender_fleet.sources.places import is_url, local_copy
from bender_loop.errors import InputError
from bender_loop.shell.files import read_text_file

REQUIRED, OPTIONAL = ("unit", "record"), ("model", "date", "batch")
MOST_BYTES = 1 << 28
_LONGEST_NAME = 200


class ManifestRow(NamedTuple):
    """One record of a unit; `place` says where the row stands, for messages."""

    unit: str
    record: str
    model: str | None
    date: str | None
    batch: str | None
    more: tuple[tuple[str, str], ...]
    place: str


def is_manifest(source: str) -> bool:
    """Return whether a source is a table of units: a CSV or Parquet file whose columns name a unit or a record."""
    if any(mark in source for mark in "*?["):
        return False
    ending = source.lower().rpartition(".")[2]
    if ending not in ("csv", "parquet") or (not is_url(source) and not Path(source).is_file()):
        return False
    with local_copy(source) as path:
        header = _parquet_header(path) if ending == "parquet" else _csv_header(path)
    return bool({"unit", "record"} & set(header)) and not {"time_s", "voltage_V"} <= set(header)


def read_manifest(source: str) -> list[ManifestRow]:
    """Return the rows of a manifest; paths of records in it are relative to the place of the manifest.

    Raises:
        InputError: a column is missing, a cell is empty or no date, or there are no rows.
    """
    with local_copy(source) as path:
        rows = list(_parquet_rows(path) if path.suffix.lower() == ".parquet" else _csv_rows(path, source))
    if not rows:
        raise InputError(f"{source}: found no rows below the header, expected one for each record")
    missing = [name for name in REQUIRED if name not in rows[0][1]]
    if missing:
        raise InputError(
            f"{source}, column {missing[0]}: no such column; found {', '.join(rows[0][1])}, expected at least "
            f"{' and '.join(REQUIRED)}"
        )
    return [_row(source, place, cells) for place, cells in rows]


def _row(source: str, place: str, cells: Mapping[str, str]) -> ManifestRow:
    for name in REQUIRED:
        if not cells[name]:
            raise InputError(f"{source}, {place}, column {name}: found an empty cell, expected a {name}")
    name = cells["unit"]
    if len(name) > _LONGEST_NAME or not name.isprintable():
        raise InputError(
            f"{source}, {place}, column unit: found {name[:40]!r}, expected at most {_LONGEST_NAME} printable signs"
        )
    more = tuple((k, v) for k, v in cells.items() if k not in (*REQUIRED, *OPTIONAL))
    model = cells.get("model") or None
    return ManifestRow(
        name,
        _beside(source, cells["record"]),
        _model(source, model),
        _day(source, place, cells.get("date", "")),
        cells.get("batch") or None,
        more,
        place,
    )


def _day(source: str, place: str, text: str) -> str | None:
    if not text:
        return None
    try:
        return date.fromisoformat(text[:10]).isoformat()
    except ValueError:
        raise InputError(
            f"{source}, {place}, column date: found {text!r}, expected a day such as 2026-03-31, or nothing"
        ) from None


def _beside(source: str, record: str) -> str:
    """Return where a record lies that a manifest names."""
    if is_url(record) or Path(record).is_absolute():
        return record
    if is_url(source):
        return f"{source.rpartition('/')[0]}/{record}"
    return str(Path(source).parent / record)


def _model(source: str, model: str | None) -> str | None:
    if model is None or is_url(source) or Path(model).is_absolute():
        return model
    beside = Path(source).parent / model
    return str(beside) if beside.is_file() else model


def _csv_header(path: Path) -> list[str]:
    with path.open("rb") as file:
        text = file.readline(1 << 16).decode("utf-8-sig", errors="replace")
    return [x.strip() for x in next(csv.reader([text]), [])]


def _csv_rows(path: Path, source: str) -> Iterator[tuple[str, dict[str, str]]]:
    text = read_text_file(path, MOST_BYTES, "a manifest (CSV)")
    reader = csv.reader(io.StringIO(text, newline=""))
    header = [x.strip() for x in next(reader, [])]
    if len(set(header)) != len(header):
        twice = next(x for x in header if header.count(x) > 1)
        raise InputError(f"{source}, line 1, column {twice}: found it twice, expected each column once")
    for cells in reader:
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) != len(header):
            raise InputError(
                f"{source}, line {reader.line_num}: found {len(cells)} cells, expected {len(header)} as in the header"
            )
        yield f"line {reader.line_num}", {k: v.strip() for k, v in zip(header, cells, strict=True)}


def _parquet_header(path: Path) -> list[str]:
    return [str(x) for x in _parquet(path).schema_arrow.names]


def _parquet_rows(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    table = _parquet(path).read()
    for number, row in enumerate(table.to_pylist(), 1):
        yield f"row {number}", {str(k): _text(v) for k, v in row.items()}


def _parquet(path: Path) -> Any:
    from pyarrow import ArrowException
    from pyarrow.parquet import ParquetFile

    try:
        return ParquetFile(path)
    except (ArrowException, OSError) as error:
        raise InputError(f"{path}: is not a Parquet file ({str(error).partition(chr(10))[0][:160]})") from None


def _text(value: Any) -> str:
    return "" if value is None else str(value).strip()
