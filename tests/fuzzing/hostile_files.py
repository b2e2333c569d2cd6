"""Files that nobody would give on purpose: text with strange values in it, and things that are no files of text."""

import math
import os
import random
import re
from collections.abc import Callable
from pathlib import Path

CELLS = (
    "", " ", "nan", "inf", "-inf", "1e308", "-1.7e308", "5e-324", "1e999", "0", "-0.0", "-1", "1e-300", "1e17", "abc",
    "1_0", "0x10", "9" * 400, "9" * 5000, "\x00", "é", "−5", '"', '"1"', "1,5", "1;5", "=1+1", "true", "1e", "\u202e1",
)  # fmt: skip
VALUES = (
    "nan", "inf", "-inf", "1e308", "-1.7e308", "5e-324", "0", "0.0", "-1", "1e300", "9" * 400, "9" * 5000, "true",
    '""', '"x"', '"a\\u0000b"', "[]", "[[]]", "{}", "[1, 2, 3]", "[nan]", "1979-05-27", "0x7fffffffffffffffffff",
    "[" * 3000, "[" * 3000 + "]" * 3000, "1e999", '"' + "x" * 5000 + '"', "'../../etc/passwd'", "1e17", "0b1",
)  # fmt: skip
_ROWS = 80
_HEAD = "time_s,voltage_V,displacement_um"
_WORD = "[A-Za-z_]+"


def strange_record(path: Path, rng: random.Random) -> str:
    """Write a damaged record; returns what was done to it."""
    times = [k / 30 for k in range(_ROWS)]
    rows = [[t, 25.0 - 25.0 * math.cos(6.0 * t), 12.0 - 12.0 * math.cos(6.0 * t - 0.2)] for t in times]
    what = rng.choice(("cells", "cells", "cells", "numbers", "numbers", "numbers", "text", "text", "special"))
    if what == "special":
        return special_file(path, rng)
    if what == "text":
        return _whole_text(path, _HEAD, [",".join(map(repr, row)) for row in rows], rng)
    change = _cells if what == "cells" else rng.choice((_scaled, _constant, _gap, _jump))
    path.write_text("\n".join([_HEAD, *(",".join(row) for row in change(rows, rng))]) + "\n", encoding="utf-8")
    return change.__name__.strip("_")


def strange_settings(path: Path, rng: random.Random, sound: str) -> str:
    """Write damaged settings (TOML); returns what was done to them."""
    lines = sound.splitlines()
    what = rng.choice(("value", "value", "value", "value", "key", "line", "text", "special"))
    if what == "special":
        return special_file(path, rng)
    if what == "text":
        return _whole_text(path, lines[0], lines[1:], rng)
    places = [k for k, line in enumerate(lines) if " = " in line and not line.startswith("#")]
    for _ in range(rng.choice((1, 1, 2))):
        k = rng.choice(places)
        name, _, _ = lines[k].partition(" = ")
        if what == "value":
            lines[k] = f"{name} = {rng.choice(VALUES)}"
        elif what == "key":
            lines[k] = re.sub(_WORD, rng.choice(("bogus", "id", "format", "''", "é", "a.b")), lines[k], count=1)
        else:
            lines[k] = rng.choice(("", lines[k] + "\n" + lines[k], "[[", "= 1", lines[rng.choice(places)]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return what


def _cells(rows: list[list[float]], rng: random.Random) -> list[list[str]]:
    cells = [list(map(repr, row)) for row in rows]
    for _ in range(rng.choice((1, 1, 5))):
        cells[rng.randrange(_ROWS)][rng.randrange(3)] = rng.choice(CELLS)
    return cells


def _scaled(rows: list[list[float]], rng: random.Random) -> list[list[str]]:
    column, factor = rng.randrange(3), 10.0 ** rng.choice((-300, -30, -12, -9, -6, 6, 9, 12, 30, 300))
    return [[repr(x * factor) if k == column else repr(x) for k, x in enumerate(row)] for row in rows]


def _constant(rows: list[list[float]], rng: random.Random) -> list[list[str]]:
    column, value = rng.randrange(3), rng.choice(("0", "nan", "1e308", "", "5e-324", "-7"))
    return [[value if k == column else repr(x) for k, x in enumerate(row)] for row in rows]


def _gap(rows: list[list[float]], rng: random.Random) -> list[list[str]]:
    at, gap_s = rng.randrange(_ROWS), rng.choice((-1.0, 0.0, 1e7, 1e9, 1e12, 1e300))
    return [[repr(row[0] + gap_s * (k >= at)), *map(repr, row[1:])] for k, row in enumerate(rows)]


def _jump(rows: list[list[float]], rng: random.Random) -> list[list[str]]:
    column, value = rng.choice((1, 2)), rng.choice((1e8, -1e12, 1.7e308, -1e308, 1e20))
    at = rng.randrange(_ROWS)
    return [[repr(value if (k, j) == (at, column) else x) for j, x in enumerate(row)] for k, row in enumerate(rows)]


def _whole_text(path: Path, head: str, lines: list[str], rng: random.Random) -> str:
    text = "\n".join([head, *lines]) + "\n"
    ways: dict[str, Callable[[], bytes]] = {
        "empty": lambda: b"",
        "head only": lambda: head.encode(),
        "one line": lambda: f"{head}\n{lines[0]}\n".encode(),
        "cut": lambda: text[: rng.randrange(len(text))].encode(),
        "bytes": lambda: bytes(b ^ rng.randrange(256) if rng.random() < 0.02 else b for b in text.encode()),
        "noise": lambda: rng.randbytes(2000),
        "utf-16": lambda: text.encode("utf-16"),
        "semicolons": lambda: text.replace(",", ";").encode(),
        "tabs": lambda: text.replace(",", "\t").encode(),
        "carriage returns": lambda: text.replace("\n", "\r").encode(),
        "quote": lambda: ('"' + text).encode(),
        "other head": lambda: (rng.choice(("a,b,c", "time_s,time_s,voltage_V", ",,", "{}", "\x00")) + text).encode(),
        "zeros": lambda: bytes(5000),
        "long line": lambda: text.encode() + b"1," * 200_000,
    }
    name = rng.choice(list(ways))
    path.write_bytes(ways[name]())
    return name


def special_file(path: Path, rng: random.Random) -> str:
    """Put something else than a file of text under that name; return what."""
    what = rng.choice(("missing", "directory", "pipe", "device", "loop", "huge"))
    if what == "directory":
        path.mkdir()
    elif what == "pipe" and hasattr(os, "mkfifo"):
        os.mkfifo(path)
    elif what == "device" and os.name == "posix":
        path.symlink_to("/dev/zero")
    elif what == "loop" and os.name == "posix":
        path.symlink_to(path)
    elif what == "huge":
        with path.open("wb") as file:
            file.truncate(3 << 30)  # of holes: it takes no room on the disk
    return what
