"""Units from directories, globs and manifests."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

from bender_fleet.sources.manifest import ManifestRow, is_manifest, read_manifest
from bender_fleet.sources.places import matching
from bender_loop.errors import InputError


@dataclass(frozen=True, slots=True)
class Unit:
    """One unit and its records, which share one physics.

    Attributes:
        name: of the unit, unique in the fleet.
        records: paths or URLs.
        model: a model file or built-in name; None for that of the whole fleet.
        date: the day of the unit as YYYY-MM-DD; None where none is given.
        batch: that the unit is from; None where none is given.
        more: further columns of the manifest and their text.
    """

    name: str
    records: tuple[str, ...]
    model: str | None = None
    date: str | None = None
    batch: str | None = None
    more: tuple[tuple[str, str], ...] = ()


def find_units(sources: Sequence[str]) -> list[Unit]:
    """Return the units of all sources in the order of their names.

    Args:
        sources: directories, globs, single records and manifests, on local disks or behind URLs. Of a directory or
            glob each file is a unit, named like the file; a manifest is a CSV or Parquet file with the columns
            `unit` and `record`.

    Raises:
        InputError: a source holds no records, a manifest is wrong, or two sources name one unit.
    """
    found: dict[str, Unit] = {}
    for source in sources:
        units = _of_manifest(source) if is_manifest(source) else _of_files(source)
        for unit in units:
            if unit.name in found:
                raise InputError(
                    f"{source}: found unit {unit.name} again, expected each unit in one source only; "
                    "list its records under one name in a manifest"
                )
            found[unit.name] = unit
    return [found[name] for name in sorted(found)]


def _of_files(source: str) -> list[Unit]:
    places = matching(source)
    stems: dict[str, str] = {}
    for place in places:
        name = PurePosixPath(place.replace("\\", "/")).stem
        if name in stems:
            raise InputError(
                f"{source}: found {stems[name]} and {place}, expected files of different names, for they name the "
                "units; list them in a manifest with the columns unit and record"
            )
        stems[name] = place
    return [Unit(name, (place,)) for name, place in stems.items()]


def _of_manifest(source: str) -> list[Unit]:
    units: dict[str, Unit] = {}
    for row in read_manifest(source):
        units[row.unit] = _with_row(units.get(row.unit), row, source)
    return list(units.values())


def _with_row(unit: Unit | None, row: ManifestRow, source: str) -> Unit:
    """Return the unit with one more record; what is said of the unit must be the same in all its rows but the date."""
    if unit is None:
        return Unit(row.unit, (row.record,), row.model, row.date, row.batch, row.more)
    if row.record in unit.records:
        raise InputError(f"{source}, {row.place}: found record {row.record} of unit {row.unit} again, expected it once")
    for column, before, now in (("model", unit.model, row.model), ("batch", unit.batch, row.batch)):
        if before != now:
            raise InputError(
                f"{source}, {row.place}, column {column}: found {now or 'nothing'} for unit {row.unit}, expected "
                f"{before or 'nothing'} as in its rows before; give another unit another name"
            )
    first = min(_given([unit.date, row.date]), default=None)
    return replace(unit, records=(*unit.records, row.record), date=first)


def _given(values: Iterable[str | None]) -> list[str]:
    return [x for x in values if x is not None]
