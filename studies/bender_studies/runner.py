"""What benchmarks share: numbers that are checked, work in processes, and an interrupt that keeps what is done."""

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

from bender_loop.errors import InputError, RunError

T = TypeVar("T")
INTERRUPTED = 130


def check_least(arguments: argparse.Namespace, least: int, *names: str) -> None:
    """Refuse an option that is given with a number below the least one, by its name."""
    for name in names:
        value = getattr(arguments, name)
        if value is not None and value < least:
            raise InputError(f"--{name.replace('_', '-')}: found {value}, expected at least {least}")


def check_known(option: str, names: Iterable[str], known: Iterable[str]) -> None:
    """Refuse a name that is none of the known ones."""
    known = tuple(known)
    for name in names:
        if name not in known:
            raise InputError(f"{option}: found {name!r}, expected one of {', '.join(known)}")


def silence() -> None:
    """Keep the libraries of a process to one thread: the workers share the processors."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)


@contextmanager
def workers(
    jobs: int | None, prepare: Callable[..., object] = silence, prepared: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """Processes of one thread each, one per processor unless told; what waits is dropped when they are left early."""
    count, context = jobs or os.cpu_count() or 1, get_context("spawn")
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=prepare, initargs=prepared)
    try:
        yield pool
    except BrokenProcessPool as error:
        raise RunError("a process of the benchmark died, out of memory perhaps; try --jobs 1") from error
    finally:
        pool.shutdown(cancel_futures=True)


def in_processes(
    work: Callable[..., T], tasks: Iterable[tuple[Any, ...]], jobs: int | None, *, in_order: bool = True
) -> Iterator[T]:
    """Yield what the work makes of the arguments of each task, in their order or as it comes."""
    with workers(jobs) as pool:
        waiting = [pool.submit(work, *task) for task in tasks]
        yield from (x.result() for x in (waiting if in_order else as_completed(waiting)))


def collected(
    results: Iterable[T],
    title: str,
    in_words: Callable[[T], str],
    total: int | None = None,
    keep: Callable[[list[T]], object] = lambda _: None,
) -> tuple[list[T], int]:
    """Return the results and the exit status; `keep` is given all so far after each, an interrupt keeps those."""
    from bender_loop.shell.progress import Progress

    found: list[T] = []
    with Progress(title) as bar:
        try:
            for result in results:
                found.append(result)
                bar.update(len(found), total, in_words(result))
                keep(found)
        except KeyboardInterrupt:
            return found, INTERRUPTED
    return found, 0


def write_facts(path: Path, facts: Mapping[str, Any]) -> None:
    """Write facts as JSON, null for what is not finite, and say where."""
    from bender_loop.shell.files import finite, write_result

    write_result(path, finite(facts))
    sys.stdout.write(f"written: {path}\n")
