"""The tables of units and effects, made of the parts; the same whoever made the parts and in which order."""

import os
import secrets
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

from bender_fleet.results.columns import effect_schema, unit_schema
from bender_fleet.results.parts import Part, find_part
from bender_fleet.sources.units import Unit

UNIT_TABLE, EFFECT_TABLE, TIME_TABLE = "units.parquet", "effects.parquet", "times.parquet"
_AT_ONCE = 500


@dataclass(frozen=True, slots=True)
class Planned:
    """A unit with the folder of its files and the key of its work."""

    unit: Unit
    folder: str
    key: str
    model: str


def write_tables(out: Path, action: str, planned: Sequence[Planned]) -> dict[str, int]:
    """Write the tables of the units that have a part; return how many units have which status.

    Raises:
        OSError: they cannot be written.
    """
    more = tuple(dict.fromkeys(name for x in planned for name, _ in x.unit.more))
    schema = unit_schema(action, more)
    counts: dict[str, int] = {}
    times: list[dict[str, Any]] = []

    def parts() -> Iterator[tuple[Planned, Part]]:
        for x in planned:
            part = find_part(out, x.folder, x.key)
            if part is not None:
                counts[part.status] = counts.get(part.status, 0) + 1
                times.append({"unit": x.unit.name, "run": part.run, "seconds": part.seconds})
                yield x, part

    def rows() -> Iterator[tuple[dict[str, Any], list[dict[str, Any]]]]:
        for x, part in parts():
            yield _row(x, part, schema.names, more), [{"unit": x.unit.name, **e} for e in part.effects]

    _stream(out, rows(), schema)
    _write_times(out / TIME_TABLE, times)
    return counts


def _stream(out: Path, rows: Iterable[tuple[dict[str, Any], list[dict[str, Any]]]], schema: Any) -> None:
    """Write both tables some hundred units at a time, and move them into place together."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    mark = secrets.token_hex(4)
    temporary = {name: out / f".{name}.{mark}.tmp" for name in (UNIT_TABLE, EFFECT_TABLE)}
    try:
        with (
            pq.ParquetWriter(temporary[UNIT_TABLE], schema) as units,
            pq.ParquetWriter(temporary[EFFECT_TABLE], effect_schema()) as effects,
        ):
            for some in _chunks(rows):
                units.write_table(pa.Table.from_pylist([row for row, _ in some], schema))
                effects.write_table(pa.Table.from_pylist([e for _, own in some for e in own], effect_schema()))
        for name, path in temporary.items():
            os.replace(path, out / name)
    finally:
        for path in temporary.values():
            path.unlink(missing_ok=True)


def _chunks(rows: Iterable[Any]) -> Iterator[list[Any]]:
    some: list[Any] = []
    for row in rows:
        some.append(row)
        if len(some) == _AT_ONCE:
            yield some
            some = []
    yield some


def _row(planned: Planned, part: Part, names: Sequence[str], more: Sequence[str]) -> dict[str, Any]:
    unit = planned.unit
    day = date.fromisoformat(unit.date) if unit.date else None
    known = {
        "unit": unit.name, "date": day, "batch": unit.batch, "model": planned.model, "records": list(unit.records),
        "status": part.status, "reason": part.reason or None,
    }  # fmt: skip
    own = dict(unit.more)
    kept = dict(zip(names[len(names) - len(more) :], (own.get(x) for x in more), strict=True)) if more else {}
    return {**dict.fromkeys(names), **part.row, **known, **kept}


def _write_times(path: Path, times: list[dict[str, Any]]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema([("unit", pa.string()), ("run", pa.string()), ("seconds", pa.float64())])
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        pq.write_table(pa.Table.from_pylist(times, schema), temporary)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
