"""Tasks on one plant, in parallel processes that each open its FMU once.

Processes are spawned, not forked, so that it works alike on all systems, and every plant gets processes of its own:
two FMUs of this project never meet in one interpreter.
"""

import multiprocessing
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import cache
from multiprocessing.synchronize import Event
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self, TypeVar

from bender_loop.errors import RunError
from bender_studies.tuning.plants import BenchmarkPlant, Problem

# Windows cannot wait for more of them at once.
_MOST_PROCESSES = 61

Result = TypeVar("Result", covariant=True)


class Task(Protocol[Result]):
    """Work that can be sent to another process."""

    @property
    def weight(self) -> int:
        """Evaluations that it takes."""
        ...

    def __call__(self, problem: Problem) -> Result:
        """Do it."""
        ...


class Pool:
    """Processes for one plant; a context manager that ends all work when it is left by an error.

    Args:
        plant: which loop.
        fmu: its FMU file.
        jobs: number of processes.
        on_evaluations: called with the evaluations of every task that is done.
    """

    def __init__(self, plant: BenchmarkPlant, fmu: Path, jobs: int, on_evaluations: Callable[[int], None]) -> None:
        self._plant = plant
        self._fmu = fmu
        self._on_evaluations = on_evaluations
        context = multiprocessing.get_context("spawn")
        self._stop = context.Event()
        self._executor = ProcessPoolExecutor(
            min(jobs, _MOST_PROCESSES), context, initializer=_begin, initargs=(self._stop,)
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None:
            self._stop.set()
        self._executor.shutdown(wait=True, cancel_futures=True)

    def submit(self, tasks: Sequence[Task[Result]]) -> "list[Future[Result]]":
        """Begin tasks; those submitted first are begun first."""
        return [self._executor.submit(_do, self._plant, self._fmu, task) for task in tasks]

    def results(self, tasks: Sequence[Task[Result]], futures: "Sequence[Future[Result]]") -> list[Result]:
        """Wait for the futures of `tasks`; returns their results in the same order.

        Raises:
            InputError, RunError: what a task raised.
            RunError: a process died.
        """
        weights = {id(future): task.weight for task, future in zip(tasks, futures, strict=True)}
        try:
            for future in as_completed(futures):
                future.result()
                self._on_evaluations(weights[id(future)])
            return [future.result() for future in futures]
        except BrokenProcessPool as error:
            raise RunError(
                f"plant {self._plant.name}: a benchmark process died, out of memory perhaps; try --jobs 1"
            ) from error


class _StoppedError(Exception):
    """Ends a task whose result nobody waits for."""


_stop: Event | None = None


def _begin(stop: Event) -> None:
    """Ctrl-C reaches the whole group of processes; the parent alone decides what it means."""
    global _stop
    _stop = stop
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _go_on() -> None:
    if _stop is not None and _stop.is_set():
        raise _StoppedError


def _do(plant: BenchmarkPlant, fmu: Path, task: Task[Result]) -> Result:
    return task(_problem(plant, fmu))


@cache
def _problem(plant: BenchmarkPlant, fmu: Path) -> Problem:
    return Problem(plant, fmu, _go_on)
