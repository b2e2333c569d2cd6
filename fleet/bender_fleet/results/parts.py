"""The result of one unit: a small Parquet file that is there whole or not at all, and the unit's own files."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bender_fleet.results.columns import COMPARE, DIAGNOSE, IDENTIFY, WATCH, effect_fields, row_fields
from bender_loop.shell.files import write_atomically

if TYPE_CHECKING:
    from pyarrow import Schema

UNITS = "units"
_ENDING = ".parquet"


@dataclass(frozen=True, slots=True)
class Part:
    """What became of a unit.

    Attributes:
        key: of the content it was made of.
        run: which run made it.
        status: done, broken or failed.
        reason: why it was not done, "" otherwise.
        seconds: of wall time in the worker.
        row: what is said of the unit.
        effects: what is said of each effect.
    """

    key: str
    run: str
    status: str
    reason: str
    seconds: float
    row: Mapping[str, Any]
    effects: Sequence[Mapping[str, Any]]


def part_path(out: Path, folder: str, key: str) -> Path:
    """Return where the part of a unit lies."""
    return out / UNITS / folder / f"{key}{_ENDING}"


def write_part(out: Path, folder: str, part: Part, files: Mapping[str, bytes]) -> None:
    """Write the files of a unit and then its part, which says that they are complete; those of before vanish.

    Raises:
        InputError: a place cannot be written.
    """
    path = part_path(out, folder, part.key)
    own = path.parent
    own.mkdir(parents=True, exist_ok=True)
    for old in own.glob(f"*{_ENDING}"):
        old.unlink(missing_ok=True)
    for old in own.iterdir():
        if old.is_file() and old.name not in files:
            old.unlink(missing_ok=True)
    for name, content in files.items():
        write_atomically(own / name, content)
    write_atomically(path, _bytes(part))


def find_part(out: Path, folder: str, key: str, run: str | None = None) -> Part | None:
    """Return the part of a unit with that key, None where there is none, or none of that run."""
    path = part_path(out, folder, key)
    if not path.is_file():
        return None
    try:
        part = _part(path)
    except Exception:  # a damaged file: pyarrow fails in many ways, and the unit is simply done again
        return None
    return part if run is None or part.run == run else None


@cache
def _schema(names: tuple[str, ...]) -> "Schema":
    """Return the schema of a part whose row has these columns."""
    import pyarrow as pa

    everything = dict(kind for action in (DIAGNOSE, COMPARE, IDENTIFY, WATCH) for kind in row_fields(action))
    here = [(name, everything[name]) for name in everything if name in names]
    texts = [(name, pa.string()) for name in ("key", "run", "status", "reason")]
    row = ("row", pa.struct(here) if here else pa.null())
    return pa.schema([*texts, ("seconds", pa.float64()), row, ("of_effects", pa.list_(pa.struct(effect_fields())))])


def _bytes(part: Part) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    line = {
        "key": part.key,
        "run": part.run,
        "status": part.status,
        "reason": part.reason,
        "seconds": part.seconds,
        "row": dict(part.row) or None,
        "of_effects": [dict(x) for x in part.effects],
    }
    buffer = io.BytesIO()
    table = pa.Table.from_pylist([line], _schema(tuple(part.row)))
    pq.write_table(table, buffer, compression="none", use_dictionary=False)
    return buffer.getvalue()


def _part(path: Path) -> Part:
    import pyarrow.parquet as pq

    line = pq.ParquetFile(io.BytesIO(path.read_bytes())).read().to_pylist()[0]
    return Part(
        line["key"],
        line["run"],
        line["status"],
        line["reason"],
        line["seconds"],
        line["row"] or {},
        line["of_effects"] or [],
    )
