"""Turns a function that calls its objective into a search that asks for values.

scipy's minimisers have no ask and tell. The minimiser runs in a helper thread that stands still whenever the caller
has the word, so there is no concurrency to reason about: two queues hand the baton to and fro. The thread ends with the
search: at its end, on an error (raised again in the caller's thread), on `close`, and when the search is dropped.
"""

import sys
from collections.abc import Callable
from queue import SimpleQueue
from threading import Event, Thread
from typing import TypeAlias

import numpy as np

from bender_tuner.optimisers.search import Point, Probe, Search

Objective: TypeAlias = Callable[[Point], float]


class _StoppedError(BaseException):
    """Unwinds the minimiser; no Exception, so that no library mistakes it for a failed evaluation."""


class _Baton:
    """What the two threads share: questions one way, answers the other, and the order to stop."""

    def __init__(self) -> None:
        self.questions: SimpleQueue[Point | BaseException | None] = SimpleQueue()
        self.answers: SimpleQueue[float | None] = SimpleQueue()
        self.stopped = Event()

    def objective(self, x: Point) -> float:
        if self.stopped.is_set():
            raise _StoppedError
        self.questions.put(np.array(x, dtype=float))
        answer = self.answers.get()
        if answer is None:
            raise _StoppedError
        return answer

    def stop(self) -> None:
        self.stopped.set()
        self.answers.put(None)


def inverted(minimise: Callable[[Objective], object]) -> Search:
    """Search whose probes are the points at which `minimise` calls the objective that it is handed.

    The points are clipped to the unit box, against rounding in a library's scaling. An exception of `minimise` is
    raised where the next point would have been.
    """
    baton = _Baton()
    thread = Thread(target=_work, args=(minimise, baton), name="bender-optimiser", daemon=True)
    thread.start()
    try:
        while (question := baton.questions.get()) is not None:
            if isinstance(question, BaseException):
                raise question
            baton.answers.put((yield Probe(np.clip(question, 0.0, 1.0))))
    finally:
        baton.stop()
        # Daemon threads no longer run once the interpreter is on its way out: joining would wait for ever.
        if not sys.is_finalizing():
            thread.join()


def _work(minimise: Callable[[Objective], object], baton: _Baton) -> None:
    try:
        minimise(baton.objective)
    except _StoppedError:
        return
    except BaseException as error:
        baton.questions.put(error)
        return
    baton.questions.put(None)
