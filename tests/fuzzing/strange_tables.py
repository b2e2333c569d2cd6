"""Records in the formats of other programs, sound ones and damaged ones: spreadsheets' exports, binary containers.

A sound file has to give the record that went into it; a damaged one a record that keeps the rules, or one sentence.
"""

import importlib
import importlib.util
import io
import random
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fuzzing.hostile_files import CELLS

ROWS, MANY_ROWS = 80, 30_000
TIME_S = np.round(np.arange(MANY_ROWS) / 30.0, 6)
VOLTS = np.round(25.0 - 25.0 * np.cos(6.0 * TIME_S), 6)
READ_UM = np.round(12.0 - 12.0 * np.cos(6.0 * TIME_S - 0.2), 6)
Columns = Mapping[str, Any]
NAMES = ("time_s", "voltage_V", "displacement_um")
WORDS = ("t", "u", "y", "time_s", "", " ", "1", "99", "0", "-1", "é", "a,b", "voltage_V", "\x00", "x" * 3000)
OPTIONS: tuple[Sequence[str], ...] = (
    (), (), (), ("--columns", "t,u,y"), ("--columns", "1,2,3"), ("--columns", "3,3,3"), ("--columns", "time=t"),
    ("--delimiter", ";"), ("--delimiter", "tab"), ("--delimiter", "ab"), ("--decimal", ","), ("--decimal", "x"),
    ("--encoding", "utf-16"), ("--encoding", "cp037"), ("--encoding", "rot13"), ("--encoding", "no-such"),
    ("--encoding", "idna"), ("--skip-rows", "1"), ("--skip-rows", "79"), ("--skip-rows", "99999999"),
    ("--skip-rows", "-1"), ("--no-header",), ("--units", "ms,mV,nm"), ("--units", "s,V"), ("--units", ",,"),
)  # fmt: skip


def sound_columns(rows: int = ROWS) -> dict[str, Any]:
    """Return the columns of the record that goes into every file."""
    return dict(zip(NAMES, (TIME_S[:rows], VOLTS[:rows], READ_UM[:rows]), strict=True))


def table_case(folder: Path, rng: random.Random) -> tuple[Path, Sequence[str], str, int]:
    """Write a file into a folder; return it, the options to read it with, what was done, and its rows where sound.

    The number of rows is 0 for a file that may be refused.
    """
    kind = rng.choice(_writable()) if rng.random() < 0.6 else rng.choices(list(TEXT), _OFTEN)[0]
    done = rng.choices(("sound", "bytes", "content", "ending", "options"), (10, 40, 35, 5, 10))[0]
    rows = MANY_ROWS if kind in ("long comma", "long german") else ROWS
    columns = sound_columns(rows)
    name, write = EVERY[kind]
    data = _content(kind, write, columns, rng) if done == "content" else write(columns)
    if done == "bytes":
        data = _damaged(data, rng)
    if done == "ending":
        name = rng.choice([x for x, _ in EVERY.values()])
    path = folder / name
    path.write_bytes(data)
    options = rng.choice(OPTIONS) if done in ("options", "bytes") else ()
    return path, options, f"{kind}: {done}", rows if done == "sound" else 0


def _writable() -> list[str]:
    """Return the binary kinds whose libraries are installed."""
    return [kind for kind in BINARY if importlib.util.find_spec(LIBRARIES.get(kind, "numpy"))]


def _content(kind: str, write: Callable[[Columns], bytes], columns: Columns, rng: random.Random) -> bytes:
    if kind in TEXT:
        return _edited_text(write(columns), kind, rng)
    strange = dict(columns)
    for _ in range(rng.choice((1, 1, 2))):
        name = rng.choice([*NAMES, "further"])
        values = rng.choice(STRANGE)(np.asarray(columns.get(name, TIME_S[:ROWS])))
        strange[rng.choice((name, name, rng.choice(WORDS)))] = values
    if rng.random() < 0.2:
        strange.pop(rng.choice(NAMES), None)
    try:
        return write(strange)
    except Exception:  # the library of a format refuses to write such columns
        return _damaged(write(columns), rng)


def _edited_text(data: bytes, kind: str, rng: random.Random) -> bytes:
    encoding = "utf-16" if kind == "tabs" else "cp1252"
    lines = data.decode(encoding, "replace").splitlines()
    for _ in range(rng.choice((1, 1, 3))):
        k = rng.choice((0, 1, 2, len(lines) - 1, rng.randrange(len(lines))))
        parts = lines[k].split(";") if ";" in lines[k] else lines[k].split(",")
        parts[rng.randrange(len(parts))] = rng.choice(CELLS)
        mark = ";" if ";" in lines[k] else ","
        lines[k] = rng.choice((mark.join(parts), mark.join(parts), lines[k] * 2, "", "# remark", lines[0], mark * 5))
    return "\r\n".join(lines).encode(encoding, "replace")


def _damaged(data: bytes, rng: random.Random) -> bytes:
    damaged = bytearray(data)
    way = rng.choice(("flip", "flip", "head", "tail", "cut", "zeros", "noise", "twice", "empty", "grow"))
    if way in ("flip", "head", "tail"):
        low = max(len(data) - 600, 0) if way == "tail" else 0
        high = min(600, len(data)) if way == "head" else len(data)
        for _ in range(rng.choice((1, 2, 8, 50))):
            damaged[rng.randrange(low, high)] = rng.choice((0, 255, 127, 128, rng.randrange(256)))
        return bytes(damaged)
    at = rng.randrange(len(data) + 1)
    return {
        "cut": data[:at],
        "zeros": data[:at] + bytes(rng.choice((1, 8, 500))) + data[at + 8 :],
        "noise": data[:at] + rng.randbytes(rng.choice((4, 200))) + data[at:],
        "twice": data + data,
        "empty": b"",
    }.get(way, data[:at] + rng.choice((b"\xff", b"\x7f")) * 8 + data[at + 8 :])


STRANGE: tuple[Callable[[Any], Any], ...] = (
    lambda x: x[:-1],
    lambda x: x[:0],
    lambda x: x[:1],
    lambda x: np.concatenate([x, x]),
    lambda x: x[::-1].copy(),
    lambda x: x.reshape(-1, 1),
    lambda x: x.reshape(8, -1),
    lambda x: np.where(np.arange(x.size) == 7, np.nan, x),
    lambda x: np.where(np.arange(x.size) == 7, np.inf, x),
    lambda x: 1e300 * x,
    lambda x: np.full_like(x, 1e308),
    lambda x: np.zeros_like(x),
    lambda x: np.full_like(x, np.nan),
    lambda x: x.astype(np.complex128),
    lambda x: x.astype(np.float16),
    lambda x: x.astype(np.int8),
    lambda x: x.astype(np.uint64),
    lambda x: x > 1.0,
    lambda x: x.astype("S8"),
    lambda x: x.astype("U8"),
    lambda x: (1e9 * x).astype("datetime64[ns]"),
    lambda x: x[3],
    lambda x: np.array([{"a": 1}] * x.size, dtype=object),
)


def _parquet(columns: Columns) -> bytes:
    import pyarrow
    import pyarrow.parquet

    table = pyarrow.table({name: pyarrow.array(np.asarray(x)) for name, x in columns.items()})
    out = io.BytesIO()
    pyarrow.parquet.write_table(table, out)
    return out.getvalue()


def _npz(save: Callable[..., None]) -> Callable[[Columns], bytes]:
    def write(columns: Columns) -> bytes:
        out = io.BytesIO()
        save(out, **columns)
        return out.getvalue()

    return write


def _mat(columns: Columns) -> bytes:
    import scipy.io

    out = io.BytesIO()
    scipy.io.savemat(out, dict(columns))
    return out.getvalue()


def _hdf5(columns: Columns, group: str = "", **options: Any) -> bytes:
    import h5py

    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        for name, values in columns.items():
            file.create_dataset(f"{group}{name}", data=values, **options)
    return out.getvalue()


def _mat73(columns: Columns) -> bytes:
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM"
    return head.ljust(512, b"\x00") + _hdf5(columns)


def _tdms(columns: Columns) -> bytes:
    # npTDMS is LGPL: no extra of ours brings it
    nptdms = importlib.import_module("nptdms")
    out = io.BytesIO()
    with nptdms.TdmsWriter(out) as writer:
        writer.write_segment([nptdms.ChannelObject("run", name, np.asarray(x)) for name, x in columns.items()])
    return out.getvalue()


def _text(delimiter: str, head: Sequence[str], decimal: str, encoding: str) -> Callable[[Columns], bytes]:
    def write(columns: Columns) -> bytes:
        rows = zip(*(np.asarray(x).tolist() for x in columns.values()), strict=True)
        lines = [*head, *(delimiter.join(f"{x:.6f}".replace(".", decimal) for x in row) for row in rows)]
        return ("\r\n".join(lines) + "\r\n").encode(encoding)

    return write


_GERMAN = ("Messung vom 3. Mai;;", "Zeit [s];Spannung [V];Weg [µm]")
BINARY: Mapping[str, tuple[str, Callable[[Columns], bytes]]] = {
    "parquet": ("a.parquet", _parquet),
    "npz": ("a.npz", _npz(np.savez)),
    "npz, packed": ("a.npz", _npz(np.savez_compressed)),
    "mat 5": ("a.mat", _mat),
    "mat 7.3": ("a.mat", _mat73),
    "h5": ("a.h5", _hdf5),
    "h5, packed": ("a.hdf5", lambda x: _hdf5(x, "run/", compression="gzip")),
    "tdms": ("a.tdms", _tdms),
}
TEXT: Mapping[str, tuple[str, Callable[[Columns], bytes]]] = {
    "comma": ("a.csv", _text(",", [",".join(NAMES)], ".", "utf-8-sig")),
    "german": ("a.csv", _text(";", _GERMAN, ",", "cp1252")),
    "tabs": ("a.txt", _text("\t", ["t\tU\td"], ".", "utf-16")),
    "spaces": ("a.dat", _text("  ", ["# an instrument", "t U d", "s V µm"], ".", "cp1252")),
    "bars": ("a.csv", _text("|", ["t|u|y"], ",", "utf-8")),
    "long comma": ("a.csv", _text(",", [",".join(NAMES)], ".", "utf-8")),
    "long german": ("a.csv", _text(";", _GERMAN, ",", "cp1252")),
}
_OFTEN = [0.1 if kind.startswith("long") else 1.0 for kind in TEXT]
LIBRARIES = {"parquet": "pyarrow", "mat 7.3": "h5py", "h5": "h5py", "h5, packed": "h5py", "tdms": "nptdms"}
"""Without which there is no such kind."""
EVERY = {**BINARY, **TEXT}
