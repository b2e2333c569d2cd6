"""What a run was made with: versions, hashes, settings, for the first line of its journal."""

import contextlib
import hashlib
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

_PACKAGES = ("piezo-bender", "opencv-python-headless", "pyvisa", "pyvisa-py", "numpy", "fmpy")


def plain(calibration: Any) -> dict[str, Any]:
    """Return a calibration as a table."""
    return {name: getattr(calibration, name) for name in calibration.__dataclass_fields__}


def versions() -> dict[str, str]:
    """Return the versions of Python, the system and the packages that a run rests on."""
    found = {"python": platform.python_version(), "system": platform.platform()}
    for package in _PACKAGES:
        with contextlib.suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def sha256(path: Path | None) -> str | None:
    """Return the hash of a file, None where there is none."""
    if path is None or not path.is_file():
        return None
    return hashlib.sha256(path.read_bytes()).hexdigest()
