"""FMU archives whose bytes depend on their content only."""

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO
from xml.etree import ElementTree

_FIRST_DATE = (1980, 1, 1, 0, 0, 0)


def packed(entries: Mapping[str, bytes]) -> bytes:
    """Return a zip archive of the entries: sorted, deflated, with fixed dates and rights."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in sorted(entries):
            entry = zipfile.ZipInfo(name, _FIRST_DATE)
            entry.create_system = 3
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, entries[name], zipfile.ZIP_DEFLATED, 9)
    return buffer.getvalue()


def unpacked(path: Path | IO[bytes]) -> dict[str, bytes]:
    """Return every file of an archive by its name."""
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}


def guid_of(path: Path) -> str | None:
    """Return the GUID that an FMU bears, None where there is no FMU or none that can be read."""
    try:
        with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as description:
            _, root = next(ElementTree.iterparse(description, events=("start",)))
            return root.get("guid")
    except (OSError, KeyError, StopIteration, zipfile.BadZipFile, ElementTree.ParseError):
        return None
