"""What an FMU says of its making: the day, where its model comes from, and the report of the diagnosis."""

import io
import os
import time
from collections.abc import Mapping
from pathlib import Path

from bender_export.archive import packed, unpacked
from bender_loop.errors import InputError
from bender_plant.model import BUILT_IN, Model

REPORT = "documentation/report.html"
EPOCH = "SOURCE_DATE_EPOCH"
_MOST_REPORT_BYTES = 64 << 20
_FULL = "%Y-%m-%dT%H:%M:%SZ"
Facts = tuple[tuple[str, tuple[str, ...]], ...]
"""What is said of a making: titles, each with its lines."""


def generation_date() -> str:
    """Return this moment as FMI writes it, in UTC; that of SOURCE_DATE_EPOCH (s) where it is set.

    Raises:
        InputError: SOURCE_DATE_EPOCH is no number of seconds.
    """
    given = os.environ.get(EPOCH)
    if given is None:
        return time.strftime(_FULL, time.gmtime())
    try:
        return time.strftime(_FULL, time.gmtime(int(given)))
    except (ValueError, OverflowError, OSError):
        raise InputError(f"{EPOCH}: found {given!r}, expected a whole number of seconds since 1970") from None


def device_name(model: Model) -> str:
    """Return what an FMU of a model is called: as the device; the models that ship are piezo bending actuators."""
    return "PiezoBender" if model.name in BUILT_IN and model.origin is None else model.name


def facts_of(model: Model) -> Facts:
    """Return where a model comes from; nothing of one that was not learned."""
    origin, valid = model.origin, model.valid
    units = (origin.command_unit, origin.reading_unit) if origin else ("V", "um")
    found = []
    if origin is not None and origin.records:
        found.append(("Learned from", origin.records))
    if valid is not None:
        found.append(("Valid for", (f"commands of {valid.in_words(units[0])}",)))
    if units != ("V", "um"):
        pairs = (("V of the command", units[0]), ("um of the reading", units[1]))
        found.append(("Units", tuple(f"1 {x} stands for 1 {y}" for x, y in pairs if y != x.partition(" ")[0])))
    if origin is not None and origin.numbers:
        found.append(("Numbers", origin.numbers))
    return tuple(found)


def documents_beside(path: Path | str, model: Model) -> dict[str, bytes]:
    """Return what of a model file's origin stands beside it and goes into its FMU: the report, where it is there."""
    if model.origin is None or not model.origin.report:
        return {}
    report = Path(path).parent / model.origin.report
    try:
        is_small = report.is_file() and report.stat().st_size <= _MOST_REPORT_BYTES
        return {REPORT: report.read_bytes()} if is_small else {}
    except OSError:
        return {}


def with_documents(fmu: bytes, documents: Mapping[str, bytes]) -> bytes:
    """Return an FMU with further files in it that its code does not read."""
    return packed(unpacked(io.BytesIO(fmu)) | dict(documents)) if documents else fmu
