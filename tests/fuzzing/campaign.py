"""A campaign of mutated inputs, cut into jobs that each run in a process of their own, so that a crash is a finding."""

import multiprocessing
import os
import random
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

KINDS = ("calls", "check", "tune")
_SHARE = {"calls": 0.9, "check": 0.05, "tune": 0.05}
_IN_A_JOB = {"calls": 100, "check": 5, "tune": 5}
_CALLS, _TABLES = 12, 25
# imported once, by the process that the jobs are forked off
_HEAVY = (
    "fuzzing.commands",
    "fuzzing.calls",
    "bender_loop.fmu.check.check",
    "bender_tuner.task.session",
    "fuzzing.table_reading",
)
JOB_SECONDS = 120.0


@dataclass(frozen=True, slots=True)
class Job:
    """Cases `first` to `first + count - 1` of one kind."""

    kind: str
    first: int
    count: int


def jobs(cases: int) -> list[Job]:
    """Cut a number of cases into jobs, every kind with its share."""
    found = []
    for kind in KINDS:
        total = round(cases * _SHARE[kind])
        size = _IN_A_JOB[kind]
        found += [Job(kind, first, min(size, total - first)) for first in range(0, total, size)]
    return found


def table_jobs(cases: int) -> list[Job]:
    """Cut a number of records in other formats into jobs."""
    return [Job("tables", first, min(_TABLES, cases - first)) for first in range(0, cases, _TABLES)]


def run_campaign(
    fmus: dict[str, Path],
    cases: int,
    seed: int,
    processes: int,
    tell: Callable[[int, int], None],
    tables: int = 0,
) -> list[str]:
    """Run a campaign; returns the complaints.

    Args:
        fmus: the FMUs by a name; the first one is damaged, all of them are called.
        cases: how many inputs.
        seed: the same seed gives the same inputs.
        processes: how many at a time.
        tell: is told the number of cases that are done, and of all.
        tables: records in other formats beside these.
    """
    waiting, complaints, done = [*jobs(cases), *table_jobs(tables)], [], 0
    total = sum(job.count for job in waiting)
    context = _processes()
    running: list[tuple[Job, Any, Any, float]] = []
    with tempfile.TemporaryDirectory(prefix="bender-fuzz-") as folder:
        while waiting or running:
            while waiting and len(running) < processes:
                running.append(_started(context, waiting.pop(0), fmus, seed, Path(folder)))
            for entry in _ended(running):
                running.remove(entry)
                complaints += _outcome(*entry)
                done += entry[0].count
                tell(done, total)
            time.sleep(0.005)
    return complaints


def run_job(job: Job, fmus: dict[str, Path], seed: int, folder: Path) -> list[str]:
    """Run the cases of one job in this process; returns the complaints."""
    if job.kind == "calls":
        return [text for k in range(job.first, job.first + job.count) for text in _called(k, fmus, seed, job)]
    if job.kind == "tables":
        return list(_tables(job, seed, folder))
    from fuzzing.commands import check_case, tune_case

    case = check_case if job.kind == "check" else tune_case
    fmu = next(iter(fmus.values())).read_bytes()
    found = []
    for k in range(job.first, job.first + job.count):
        place = folder / f"{job.kind}-{k}"
        place.mkdir()
        found += [f"{job.kind} {k}: {text}" for text in case(fmu, _numbers(seed, job.kind, k), place)]
    return found


def _tables(job: Job, seed: int, folder: Path) -> Iterator[str]:
    from fuzzing.table_reading import bound_memory, read_case

    bound_memory()
    for k in range(job.first, job.first + job.count):
        place = folder / f"tables-{k}"
        place.mkdir()
        yield from (f"tables {k}: {text}" for text in read_case(_numbers(seed, job.kind, k), place))
        shutil.rmtree(place)


_fuzzers: dict[Path, Any] = {}


def _called(k: int, fmus: dict[str, Path], seed: int, job: Job) -> Iterator[str]:
    from fuzzing.calls import CallFuzzer

    path = list(fmus.values())[k % len(fmus)]
    random_numbers = _numbers(seed, job.kind, k)
    fuzzer = _fuzzers.get(path)
    if fuzzer is None:
        fuzzer = _fuzzers[path] = CallFuzzer(path, random_numbers)
    fuzzer.random, fuzzer.complaints = random_numbers, []
    fuzzer.run(_CALLS)
    yield from (f"calls {k}: {text}" for text in fuzzer.complaints)


def _processes() -> Any:
    """Processes that are forked off one that has the libraries loaded, where the platform can do that."""
    if os.name != "posix":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(_HEAVY))
    return context


def _numbers(seed: int, kind: str, k: int) -> random.Random:
    return random.Random(f"{seed} {kind} {k}")


def _started(context: Any, job: Job, fmus: dict[str, Path], seed: int, folder: Path) -> tuple[Job, Any, Any, float]:
    receiving, sending = context.Pipe(duplex=False)
    process = context.Process(target=_child, args=(sending, job, fmus, seed, folder), daemon=True)
    process.start()
    sending.close()
    return job, process, receiving, time.monotonic()


def _child(sending: Any, job: Job, fmus: dict[str, Path], seed: int, folder: Path) -> None:
    found = run_job(job, fmus, seed, folder)
    for fuzzer in _fuzzers.values():
        fuzzer.close()
    sending.send(found)
    sending.close()


def _ended(running: list[tuple[Job, Any, Any, float]]) -> list[tuple[Job, Any, Any, float]]:
    now = time.monotonic()
    for _, process, _, begun in running:
        if process.is_alive() and now - begun > JOB_SECONDS:
            process.kill()
            process.join()
    return [entry for entry in running if entry[2].poll() or not entry[1].is_alive()]


def _outcome(job: Job, process: Any, receiving: Any, begun: float) -> list[str]:
    found: list[str] = []
    try:
        found = receiving.recv() if receiving.poll() else []
    except EOFError:
        found = []
    process.join(JOB_SECONDS)
    if process.exitcode != 0:
        took = time.monotonic() - begun
        found.append(
            f"{job.kind} {job.first} to {job.first + job.count - 1}: exit code {process.exitcode} after {took:.0f} s"
        )
    return found
