"""What a command shows while it works and when it is done: a progress line and a table.

On a terminal both are drawn by rich (which honours NO_COLOR); in a pipe, a log or a dumb terminal they are
plain lines, one every two seconds at most. Progress goes to the standard error, tables to the standard output.
"""

import os
import sys
import time
from collections.abc import Callable, Sequence
from numbers import Real
from types import TracebackType
from typing import TYPE_CHECKING, Self, TextIO

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

    def __enter__(self) -> Self:
        if is_rich(self._stream):
            bar = _bar(self._stream)
            self._task = bar.add_task(self._title, total=None, text="")
            bar.start()
            self._bar = bar
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def update(self, done: int, total: int | None = None, text: str = "") -> None:
        """Say that `done` of `total` (None: unknown) units are finished; `text` is a remark of the moment."""
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=done, total=total, text=text)
            return
        now_s = self._clock()
        if now_s - self._written_s >= self._interval_s:
            self._written_s = now_s
            self._stream.write(_line(self._title, done, total, text) + "\n")
            self._stream.flush()


def print_table(
    title: str, columns: Sequence[str], rows: Sequence[Sequence[Cell]], stream: TextIO | None = None
) -> None:
    """Print a table: drawn on a terminal, aligned plain text elsewhere.

    Numbers are aligned right, floats with four significant digits, None as a dash. Format a cell yourself, as
    a string, where it needs something else.

    Raises:
        ValueError: a row has not as many cells as there are columns.
    """
    for row in rows:
        if len(row) != len(columns):
            raise ValueError(f"table {title!r}: expected {len(columns)} cells in a row, found {row!r}")
    target: TextIO = stream or sys.stdout
    texts = [[_cell(value) for value in row] for row in rows]
    right = [any(isinstance(row[k], Real) for row in rows) for k in range(len(columns))]
    if is_rich(target):
        _print_rich(title, columns, texts, right, target)
    else:
        target.write("\n".join(_plain_lines(title, columns, texts, right)) + "\n")


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


def _plain_lines(title: str, columns: Sequence[str], texts: list[list[str]], right: list[bool]) -> list[str]:
    widths = [max(len(row[k]) for row in [columns, *texts]) for k in range(len(columns))]

    def line(cells: Sequence[str]) -> str:
        padded = (c.rjust(w) if r else c.ljust(w) for c, w, r in zip(cells, widths, right, strict=True))
        return "  ".join(padded).rstrip()

    return [title, line(columns), line(["-" * width for width in widths]), *(line(row) for row in texts)]


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
