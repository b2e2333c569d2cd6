"""One run of a command: what it was asked, what it reads, how much it says, and the document that it answers with.

`bender` opens a run around every command; without one, as in a notebook, everything here is silent and changes
nothing. Every result of a run carries its `provenance`.
"""

import contextlib
import hashlib
import os
import shlex
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TextIO

from bender_loop.errors import InputError

DISTRIBUTION = "piezo-bender"


@dataclass(frozen=True, slots=True)
class Table:
    """A table that was printed.

    Attributes:
        title: above it.
        columns: (k,) their names.
        rows: (n, k) cells as they were printed.
        right: (k,) whether a column holds numbers.
        of_cases: each row is one of many cases, which a page of figures leaves out.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    right: Sequence[bool]
    of_cases: bool = False


@dataclass(slots=True)
class Run:
    """A command at work.

    Attributes:
        command: as it was typed, quoted for a shell.
        quiet: no progress and no remarks.
        verbose: every step as a line of its own, with the seconds since the beginning.
        log: where the same lines go, with date and time; None without a log.
        began: when.
        inputs: SHA-256 of every file that was read, by its name.
        written: every file that was written, in order.
        answer: what `--json` prints; None where the command has not said.
        tables: every table that was printed, in order.
        doing: the last line of progress.
        said_s: when something was last said, on the monotonic clock; None before.
        is_shown: whether a bar on a terminal shows what is going on.
        held: remarks that are said with whatever is said next, and dropped where the input is refused.
        remarked: every remark that was ever held.
    """

    command: str
    quiet: bool = False
    verbose: bool = False
    log: TextIO | None = None
    began: datetime = field(default_factory=lambda: datetime.now(UTC))
    inputs: dict[str, str] = field(default_factory=dict)
    written: list[str] = field(default_factory=list)
    answer: Mapping[str, Any] | Sequence[Any] | None = None
    tables: list[Table] = field(default_factory=list)
    doing: str = ""
    said_s: float | None = None
    is_shown: bool = False
    held: list[str] = field(default_factory=list)
    remarked: set[str] = field(default_factory=set)
    _began_s: float = field(default_factory=time.monotonic)

    def note(self, line: str) -> None:
        """Write a line to the log and, where the run is verbose, to the standard error."""
        if self.verbose:
            with contextlib.suppress(OSError):
                sys.stderr.write(f"[{time.monotonic() - self._began_s:8.2f} s] {line}\n")
                sys.stderr.flush()
        if self.log is not None:
            with contextlib.suppress(OSError, ValueError):
                self.log.write(f"{datetime.now(UTC).isoformat(timespec='milliseconds')} {line}\n")
                self.log.flush()


_running: list[Run] = []


def current() -> Run | None:
    """Return the run that is going on, None outside of any."""
    return _running[-1] if _running else None


@contextlib.contextmanager
def running(run: Run) -> Iterator[Run]:
    """Make a run the current one."""
    _running.append(run)
    try:
        run.note(
            f"{DISTRIBUTION} {version()}, Python {sys.version.split()[0]} on {sys.platform}, in {_working_folder()}"
        )
        run.note(f"command: {run.command}")
        yield run
        say_held()
    except InputError:
        # one line says what is wrong; what is held is no part of it
        run.held.clear()
        raise
    finally:
        _running.remove(run)


def _working_folder() -> str:
    try:
        return str(Path.cwd())
    except OSError:
        return "a folder that has been removed"


def going_on(option: str, folder: Path) -> str:
    """Return the command of this run with an option that goes on from a folder, quoted for a shell."""
    run = current()
    words = shlex.split(run.command) if run is not None else []
    for k in [k for k, word in enumerate(words) if word == option or word.startswith(f"{option}=")][::-1]:
        del words[k : k + (2 if words[k] == option else 1)]
    return shlex.join([*words, option, str(folder)])


def command_line(words: Sequence[str]) -> str:
    """Return the words after `bender` as one line that a shell would read as these words."""
    return shlex.join(["bender", *words])


def version() -> str:
    """Return the installed version, "unknown" without an installed distribution."""
    from importlib import metadata

    try:
        return metadata.version(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return "unknown"


def note_input(path: Path | str, content: bytes | None = None) -> None:
    """Remember a file that the current run reads, by its SHA-256.

    Args:
        path: of the file; one that cannot be read is left to whoever reads it.
        content: what it holds, where that is at hand.
    """
    run, name = current(), str(path)
    if run is None or name in run.inputs:
        return
    with contextlib.suppress(OSError, ValueError):
        if os.stat(path).st_mtime > run.began.timestamp():  # made by this run itself
            return
        found = hashlib.sha256(content).hexdigest() if content is not None else _digest(path)
        run.inputs[name] = found
        run.note(f"read: {name}, sha256 {found}")


def note_written(path: Path | str) -> None:
    """Remember a file that the current run has written."""
    run = current()
    if run is not None and str(path) not in run.written:
        run.written.append(str(path))
        run.note(f"written: {path}")


def remark(sentence: str) -> None:
    """Write a remark to the standard error, unless the run is quiet; it stands in the log all the same."""
    _say(sentence, f"bender: {sentence}")


def remark_held(sentence: str) -> None:
    """Hold a remark on the input until something else is said: input that is refused is answered with one line.

    What is read several times is remarked on once.
    """
    run = current()
    if run is None:
        remark(sentence)
        return
    if sentence in run.remarked:
        return
    run.remarked.add(sentence)
    run.note(sentence)
    run.held.append(sentence)


def say_held() -> None:
    """Say the remarks that are held."""
    run = current()
    if run is None:
        return
    held, run.held = run.held, []
    if not (run.quiet or run.verbose):
        for sentence in held:
            _write(f"bender: {sentence}")


def doing(what: str) -> None:
    """Name the work that goes on, for the line that comes after a while of silence and for the log."""
    run = current()
    if run is not None:
        run.doing = what
        run.note(what)


def step(line: str) -> None:
    """Write the heading of a step to the standard error, unless the run is quiet; it stands in the log all the same."""
    _say(line, line)


def _say(noted: str, said: str) -> None:
    run = current()
    if run is not None:
        run.doing, run.said_s = noted, time.monotonic()
        run.note(noted)
    if run is None or not (run.quiet or run.verbose):
        say_held()
        _write(said)


def _write(line: str) -> None:
    with contextlib.suppress(OSError):
        sys.stderr.write(f"{line}\n")
        sys.stderr.flush()


def provenance() -> dict[str, Any]:
    """Return where a result comes from: `command` (None from Python), `version`, `date` in UTC, `inputs` by SHA-256."""
    run = current()
    began = datetime.now(UTC) if run is None else run.began
    return {
        "command": None if run is None else run.command,
        "version": version(),
        "date": began.isoformat(timespec="seconds"),
        "inputs": {} if run is None else dict(run.inputs),
    }


def provenance_line() -> str:
    """Return the provenance as one sentence, for the foot of a page."""
    found = provenance()
    made = f"Made by {DISTRIBUTION} {found['version']} on {found['date'].replace('T', ' ').replace('+00:00', ' UTC')}"
    command = "" if found["command"] is None else f" with: {found['command']}"
    inputs = ", ".join(f"{Path(name).name} (SHA-256 {digest[:12]}…)" for name, digest in found["inputs"].items())
    return f"{made}{command}" + (f"; from {inputs}" if inputs else "")


def with_provenance(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Return facts with the key `provenance` behind them."""
    return {**facts, "provenance": provenance()}


def answer(facts: Mapping[str, Any] | Sequence[Any]) -> None:
    """Say what `--json` prints of the current run: the same keys as the file of the result has."""
    run = current()
    if run is not None:
        run.answer = facts


def _digest(path: Path | str) -> str:
    if not os.path.isfile(path):  # a pipe would never end
        raise OSError(f"{path} is no regular file")
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
