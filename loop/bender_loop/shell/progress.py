"""What a command shows while it works and when it is done: a progress line and a table.

On a terminal both are drawn by rich (which honours NO_COLOR); in a pipe, a log or a dumb terminal they are
plain lines, one every two seconds at most. Progress goes to the standard error, tables to the standard output.
A quiet run shows no progress; a verbose one, and a log, have every step.
"""

import contextlib
import itertools
import os
import shutil
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from numbers import Real
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self, TextIO

from bender_loop.shell.run import Run, Table, current, say_held

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress
    from rich.progress import TaskID

Cell = str | int | float | None


def is_rich(stream: TextIO) -> bool:
    """Whether `stream` is a terminal that can move its cursor."""
    return stream.isatty() and os.environ.get("TERM", "") != "dumb"


class Progress:
    """How far a piece of work is, as a bar on a terminal and as sparse lines elsewhere.

    Use it as a context manager and call `update` as often as convenient; it writes seldom.

    Args:
        title: what is being done, a few words.
        stream: where to write, the standard error unless given.
        interval_s: shortest time between two plain lines.
        clock: monotonic seconds, replaced in tests.
    """

    def __init__(
        self,
        title: str,
        stream: TextIO | None = None,
        *,
        interval_s: float = 2.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._title = title
        self._stream = sys.stderr if stream is None else stream
        self._interval_s = interval_s
        self._clock = clock
        self._written_s = clock()
        self._bar: RichProgress | None = None
        self._task: TaskID | None = None
        self._run: Run | None = current()
        self._noted: tuple[str, float] = ("", -interval_s)

    def __enter__(self) -> Self:
        self._tell(self._title)
        if is_rich(self._stream) and not self._is_plain:
            say_held()
            bar = _bar(self._stream)
            self._task = bar.add_task(self._title, total=None, text="")
            bar.start()
            self._bar = bar
            if self._run is not None:
                self._run.is_shown = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None
            if self._run is not None:
                self._run.is_shown = False

    @property
    def _is_plain(self) -> bool:
        return self._run is not None and (self._run.quiet or self._run.verbose)

    def _tell(self, line: str, text: str = "") -> None:
        """Let the run know what is going on: every new text, and otherwise a line every few seconds."""
        if self._run is None:
            return
        self._run.doing = line
        now_s = self._clock()
        if text != self._noted[0] or now_s - self._noted[1] >= self._interval_s:
            self._noted = (text, now_s)
            self._run.note(line)

    def update(self, done: int, total: int | None = None, text: str = "") -> None:
        """Say that `done` of `total` (None: unknown) units are finished; `text` is a remark of the moment."""
        self._tell(_line(self._title, done, total, text), text)
        if self._is_plain:
            return
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=done, total=total, text=text)
            return
        now_s = self._clock()
        if now_s - self._written_s >= self._interval_s:
            self._written_s = now_s
            say_held()
            self._stream.write(_line(self._title, done, total, text) + "\n")
            self._stream.flush()
            if self._run is not None:
                self._run.said_s = time.monotonic()


FIRST_S, AT_ONCE_S, AGAIN_S = 1.0, 0.5, 10.0
"""Of silence, after which work is said for the first time, the same where it is known to be long, and again."""
_BEAT_S = 0.25
PLAIN_WIDTH = 100
"""Of a table of sentences where no terminal says how wide it is."""
_GAP, _FEW_WORDS = 2, 20
"""Columns of text between two cells, and the least for a cell of sentences."""
LARGE_BYTES = 32 << 20
"""A file from which on reading takes so long that it is said before anything else."""


@contextlib.contextmanager
def heartbeat(title: str, arguments: Iterable[object] = ()) -> Iterator[None]:
    """Say what the current run does while it says nothing itself.

    The first line comes when some work has a name and has gone on for a while: what is refused at once stays one line.
    Large files give it a name from the beginning.

    Args:
        title: of the command, for work without a name.
        arguments: of the command; paths among them, alone or in lists, are the files that it may read.
    """
    run = current()
    if run is None or run.quiet:
        yield
        return
    run.doing = run.doing or _large(arguments)
    over = threading.Event()
    thread = threading.Thread(target=_beat, args=(run, title, over), name="heartbeat", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _large(arguments: Iterable[object]) -> str:
    """Return what reading the first large file among the arguments is called, "" where there is none."""
    for x in arguments:
        for path in x if isinstance(x, list) else [x]:
            with contextlib.suppress(OSError):
                if isinstance(path, Path) and path.is_file() and path.stat().st_size >= LARGE_BYTES:
                    return f"reading {path.name}, {path.stat().st_size / 1e6:.0f} MB"
    return ""


def _beat(run: Run, title: str, over: threading.Event) -> None:
    began_s = time.monotonic()
    named_s, first_s = (began_s, AT_ONCE_S) if run.doing else (None, FIRST_S)
    while not over.wait(_BEAT_S):
        now_s = time.monotonic()
        if named_s is None and run.doing:
            named_s = now_s
        silent_s = now_s - max(began_s, run.said_s or began_s)
        is_first = named_s is not None and run.said_s is None and now_s - named_s >= first_s
        if not run.is_shown and (is_first or silent_s >= AGAIN_S):
            run.said_s = now_s
            say_held()
            with contextlib.suppress(OSError, ValueError):
                sys.stderr.write(f"{run.doing or title}, {now_s - began_s:.0f} s\n")
                sys.stderr.flush()


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[Cell]],
    stream: TextIO | None = None,
    *,
    of_sentences: bool = False,
    of_cases: bool = False,
) -> None:
    """Print a table: drawn on a terminal, aligned plain text elsewhere.

    Numbers are aligned right, floats with four significant digits, None as a dash. Format a cell yourself, as
    a string, where it needs something else.

    Args:
        title: above it.
        columns: their heads.
        rows: a cell for each column.
        stream: where to, the standard output unless given.
        of_sentences: cells hold sentences, which are broken into lines where the table is wider than the terminal.
        of_cases: each row is one of many cases, which a page of figures sums up.

    Raises:
        ValueError: a row has not as many cells as there are columns.
    """
    for row in rows:
        if len(row) != len(columns):
            raise ValueError(f"table {title!r}: expected {len(columns)} cells in a row, found {row!r}")
    say_held()
    target: TextIO = stream or sys.stdout
    texts = [[_cell(value) for value in row] for row in rows]
    right = [any(isinstance(row[k], Real) for row in rows) for k in range(len(columns))]
    if (run := current()) is not None:
        run.tables.append(Table(title, columns, texts, right, of_cases))
    if is_rich(target):
        _print_rich(title, columns, texts, right, target)
    else:
        width = shutil.get_terminal_size((PLAIN_WIDTH, 0)).columns if of_sentences else None
        target.write("\n".join(_plain_lines(title, columns, texts, right, width)) + "\n")


def _bar(stream: TextIO) -> "RichProgress":
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    return Bar(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[text]}", markup=False),
        console=Console(file=stream),
        transient=True,
    )


def _line(title: str, done: int, total: int | None, text: str) -> str:
    count = f"{done}" if total is None else f"{done}/{total}"
    return f"{title}: {count}" + (f", {text}" if text else "")


def _cell(value: Cell) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _plain_lines(
    title: str, columns: Sequence[str], texts: list[list[str]], right: list[bool], most: int | None = None
) -> list[str]:
    widths = [max(len(row[k]) for row in [columns, *texts]) for k in range(len(columns))]
    if most is not None:
        widths = _narrowed(widths, most - _GAP * (len(columns) - 1))
        texts = [line for row in texts for line in _broken(row, widths)]

    def line(cells: Sequence[str]) -> str:
        padded = (c.rjust(w) if r else c.ljust(w) for c, w, r in zip(cells, widths, right, strict=True))
        return (" " * _GAP).join(padded).rstrip()

    return [title, line(columns), line(["-" * width for width in widths]), *(line(row) for row in texts)]


def _narrowed(widths: list[int], most: int) -> list[int]:
    """Return widths of columns that have room beside each other: the widest give way first, down to a few words."""
    narrowed = list(widths)
    while sum(narrowed) > most and max(narrowed) > _FEW_WORDS:
        narrowed[narrowed.index(max(narrowed))] -= 1
    return narrowed


def _broken(row: list[str], widths: list[int]) -> list[list[str]]:
    """Return the lines of a row whose cells are broken between words; a word that is longer is left whole."""
    parts = [
        textwrap.wrap(x, w, break_long_words=False, break_on_hyphens=False) for x, w in zip(row, widths, strict=True)
    ]
    return [list(line) for line in itertools.zip_longest(*parts, fillvalue="")]


def _print_rich(title: str, columns: Sequence[str], texts: list[list[str]], right: list[bool], stream: TextIO) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title), title_justify="left", box=box.SIMPLE_HEAD)
    for heading, is_right in zip(columns, right, strict=True):
        table.add_column(Text(heading), justify="right" if is_right else "left")
    for row in texts:
        table.add_row(*(Text(cell) for cell in row))
    Console(file=stream).print(table)
