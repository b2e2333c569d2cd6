"""Records in binary files: Parquet, MATLAB, HDF5, NumPy, TDMS, each by its well-kept library, and what packages add.

Every one-dimensional column of numbers is offered under its name; the size is looked up before anything is unpacked.
"""

import importlib
import logging
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_loop.errors import InputError
from bender_loop.shell.extras import install_command
from bender_loop.shell.plugins import RECORD_FORMATS, installed_plugins, load_plugin
from bender_loop.tables.matlab_child import LARGE

Array = NDArray[np.float64]
MOST_VALUES = 200_000_000
"""Numbers in all columns together: 1.6 GB."""
MATLAB_SECONDS = 600.0


class TooLargeError(Exception):
    """The file says that it holds more numbers than are read."""


def columns_of(path: Path) -> dict[str, Array] | None:
    """Return the columns (n,) of a binary file by name, None where its ending is that of a text file.

    Raises:
        InputError: the library is not installed, or the file is damaged, too large, or holds no columns.
    """
    read = READERS.get(path.suffix.casefold()) or _added(path)
    if read is None:
        return None
    if not path.is_file():
        raise InputError(f"{path}: cannot be read (no such regular file); expected a record")
    try:
        found = read(path)
    except ModuleNotFoundError as error:
        # npTDMS is LGPL, so no extra of ours brings it
        how = "pip install nptdms" if error.name == "nptdms" else install_command("formats")
        raise InputError(f"{path}: files of this kind need {error.name}; {how}") from None
    except TooLargeError:
        raise InputError(f"{path}: holds more than {MOST_VALUES} numbers, expected at most that many") from None
    except (KeyboardInterrupt, InputError):
        raise
    except Exception as error:
        # a damaged file makes each library fail in its own way; none of them promises which
        reason = str(error).partition("\n")[0][:200] or type(error).__name__
        raise InputError(f"{path}: is damaged or not what its ending says ({reason})") from None
    columns = {name: np.asarray(x, dtype=np.float64) for name, x in found.items()}
    if not columns:
        raise InputError(f"{path}: found no column of numbers, expected at least time, voltage and displacement")
    return columns


def _added(path: Path) -> Callable[[Path], Mapping[str, Any]] | None:
    """Return the reader that another package adds for an ending, None where none does."""
    ending = path.suffix.casefold().removeprefix(".")
    return load_plugin(RECORD_FORMATS, ending) if ending and ending in installed_plugins(RECORD_FORMATS) else None


def _bounded(count: int) -> None:
    if count > MOST_VALUES:
        raise TooLargeError


def _flat(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is a column of numbers: one-dimensional, or with one row or one column."""
    flat = {}
    for name, values in found.items():
        array = np.asarray(values)
        if array.dtype.kind in "fiub" and array.size and max(array.shape, default=0) == array.size:
            flat[name] = array.ravel()
    return flat


def _parquet(path: Path) -> dict[str, Any]:
    parquet = importlib.import_module("pyarrow.parquet")
    file = parquet.ParquetFile(path)
    _bounded(file.metadata.num_rows * file.metadata.num_columns)
    table = file.read()
    return _flat({name: table.column(name).to_numpy(zero_copy_only=False) for name in table.column_names})


def _numpy(path: Path) -> dict[str, Any]:
    import zipfile

    with zipfile.ZipFile(path) as archive:
        _bounded(sum(x.file_size for x in archive.infolist()) // 8)
    with np.load(path, allow_pickle=False) as archive:
        return _flat({name: archive[name] for name in archive.files})


def _matlab(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        start = file.read(128)
    if b"HDF" in start[:8] or b"MATLAB 7.3" in start:
        return _hdf5(path)
    with TemporaryDirectory() as folder:
        out = Path(folder) / "columns.npz"
        words = [
            sys.executable,
            "-P",
            "-m",
            "bender_loop.tables.matlab_child",
            str(path.absolute()),
            str(MOST_VALUES),
            str(out),
        ]
        child = subprocess.run(words, capture_output=True, check=False, timeout=MATLAB_SECONDS)
        reason = child.stdout.decode("utf-8", "replace")
        if reason == LARGE:
            raise TooLargeError
        if child.returncode:
            raise ValueError(reason or "it crashes the library that reads such files")
        with np.load(out, allow_pickle=False) as found:
            return _flat({str(name): found[f"column_{k}"] for k, name in enumerate(found["names"])})


def _hdf5(path: Path) -> dict[str, Any]:
    h5py = importlib.import_module("h5py")
    found: dict[str, Any] = {}
    with h5py.File(path, "r") as file:
        named: list[tuple[str, Any]] = []
        file.visititems(lambda name, x: named.append((name, x)) if isinstance(x, h5py.Dataset) else None)
        _bounded(sum(int(x.size or 0) for _, x in named))
        for name, x in named:
            if x.dtype.kind in "fiub":
                found[name] = x[()]
    return _without_groups(_flat(found))


def _without_groups(found: dict[str, Any]) -> dict[str, Any]:
    """Return columns by their own names, by those of their groups too where two would have one name."""
    own = Counter(name.rpartition("/")[2] for name in found)
    return {last if own[last := name.rpartition("/")[2]] == 1 else name: x for name, x in found.items()}


def _tdms(path: Path) -> dict[str, Any]:
    nptdms = importlib.import_module("nptdms")
    # its warnings about damaged parts would stand beside our one line
    importlib.import_module("nptdms.log").log_manager.set_level(logging.CRITICAL)
    # it leaves a file open that it cannot read; one that is given stays ours to close
    with path.open("rb") as opened, nptdms.TdmsFile.open(opened) as file:
        channels = [c for group in file.groups() for c in group.channels()]
        _bounded(sum(len(c) for c in channels))
        names = [c.name for c in channels]
        found = {}
        for c in channels:
            found[c.name if names.count(c.name) == 1 else f"{c.group_name}/{c.name}"] = c[:]
    return _flat(found)


READERS: Mapping[str, Callable[[Path], dict[str, Any]]] = {
    ".parquet": _parquet,
    ".npz": _numpy,
    ".mat": _matlab,
    ".h5": _hdf5,
    ".hdf5": _hdf5,
    ".tdms": _tdms,
}
