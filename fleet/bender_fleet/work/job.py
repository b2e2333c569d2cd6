"""One unit's work: read, do, write, and what becomes of failures."""

import contextlib
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, Protocol

from bender_fleet.results.parts import Part, find_part, write_part
from bender_fleet.sources.places import is_url, local_copy
from bender_loop.errors import InputError, RunError

DONE, BROKEN, FAILED = "done", "broken", "failed"
_LONGEST_REASON = 600


@dataclass(frozen=True, slots=True)
class UnitResult:
    """What came of a unit.

    Attributes:
        row: of the table of units.
        effects: rows of the table of effects.
        files: names and content, for the folder of the unit.
    """

    row: Mapping[str, Any]
    effects: Sequence[Mapping[str, Any]] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)


class Work(Protocol):
    """What is done with a unit; it travels to the worker, so it holds plain values only."""

    def do(self, paths: Sequence[Path], names: Sequence[str]) -> UnitResult:
        """Return what comes of the records of a unit.

        Raises:
            InputError: the records or the model cannot be used: the unit counts as broken.
            RunError: the work failed.
        """
        ...


@dataclass(frozen=True, slots=True)
class Job:
    """One unit's work.

    Attributes:
        unit: its name.
        folder: of its files, below `units` in the output.
        key: of the content, see `sources.keys`.
        run: which run asked for it.
        records: paths or URLs.
        work: what is done.
        out: where the worker writes; None where it sends everything back.
        contents: of the records, where the worker cannot read them itself.
        again: whether an earlier run's result counts for nothing.
    """

    unit: str
    folder: str
    key: str
    run: str
    records: tuple[str, ...]
    work: Work
    out: str | None
    contents: tuple[bytes, ...] | None = None
    again: bool = False


@dataclass(frozen=True, slots=True)
class JobAnswer:
    """What a worker answers: a few words, and what the client has to write where the worker could not."""

    unit: str
    status: str
    seconds: float
    part: Part | None = None
    files: Mapping[str, bytes] = field(default_factory=dict)


def run_job(job: Job) -> JobAnswer:
    """Do a unit's work in a worker. What goes wrong with the unit is a row too; nothing is raised for it.

    A job that is asked for again because a worker died after the result was written is not done again.
    """
    if job.out is not None and (kept := find_part(Path(job.out), job.folder, job.key, job.run if job.again else None)):
        return JobAnswer(job.unit, kept.status, kept.seconds)
    began = time.perf_counter()
    status, reason, found = _attempt(job)
    part = Part(job.key, job.run, status, reason, time.perf_counter() - began, found.row, tuple(found.effects))
    if job.out is None:
        return JobAnswer(job.unit, status, part.seconds, part, found.files)
    write_part(Path(job.out), job.folder, part, found.files)
    return JobAnswer(job.unit, status, part.seconds)


def killed(job: Job, reason: str) -> Part:
    """Return the part of a unit that its workers did not survive."""
    return Part(job.key, job.run, FAILED, reason, 0.0, {}, ())


def _attempt(job: Job) -> tuple[str, str, UnitResult]:
    try:
        with _one_thread(), _at_hand(job) as paths:
            return DONE, "", job.work.do(paths, job.records)
    except InputError as error:
        return BROKEN, _line(str(error)), UnitResult({})
    except RunError as error:
        return FAILED, _line(str(error)), UnitResult({})
    except MemoryError:
        return FAILED, "out of memory; allow a worker more with --memory, or give it shorter records", UnitResult({})
    except Exception as error:
        # a fault in one unit must not end the fleet; the row says what it was
        return FAILED, _line(f"a fault in bender itself: {type(error).__name__}: {error}"), UnitResult({})


def _one_thread() -> contextlib.AbstractContextManager[object]:
    """Limit the numerics to one thread; workers of this machine are started with that limit already."""
    if os.environ.get("OMP_NUM_THREADS") == "1":
        return contextlib.nullcontext()
    from threadpoolctl import threadpool_limits

    return threadpool_limits(1)


@contextlib.contextmanager
def _at_hand(job: Job) -> Iterator[list[Path]]:
    """Give local files with the records of a job."""
    with contextlib.ExitStack() as stack:
        if job.contents is None:
            yield [stack.enter_context(local_copy(place)) for place in job.records]
            return
        folder = Path(stack.enter_context(TemporaryDirectory()))
        paths = []
        for number, (place, content) in enumerate(zip(job.records, job.contents, strict=True)):
            path = folder / str(number) / PurePosixPath(place.replace(os.sep, "/")).name
            path.parent.mkdir()
            path.write_bytes(content)
            paths.append(path)
        yield paths


def contents_of(records: Sequence[str]) -> tuple[bytes, ...] | None:
    """Return what workers without our disk need; None where the records are behind URLs, or cannot be read here."""
    if all(is_url(x) for x in records):
        return None
    found = []
    try:
        for place in records:
            with local_copy(place) as path:
                found.append(path.read_bytes())
    except (OSError, InputError):
        return None
    return tuple(found)


def _line(text: str) -> str:
    return " ".join(text.split())[:_LONGEST_REASON]
