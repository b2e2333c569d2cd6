"""A whole matrix of faults and states: cells mostly wait, so that some of them run at once, each on its own bench."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from queue import SimpleQueue

from bench_trials.fault_matrix import SETTINGS, Cell

from bender_hil.emulated import EmulatedBench
from bender_loop.errors import RunError

_TRIALS = 3
"""A busy machine may end a run before its fault comes."""

Run = Callable[[EmulatedBench, str, str, Path], Cell]


def run_matrix(
    pairs: Sequence[tuple[str, str]],
    run: Run,
    fmu: Path,
    folder: Path,
    *,
    at_once: int = 3,
) -> list[Cell]:
    """Return the cells of all pairs of fault and state, in their order.

    Args:
        pairs: of fault and state.
        run: runs one cell on a bench that nobody else uses.
        fmu: the plant behind every bench.
        folder: for what the cells leave; made here.
        at_once: so many cells run at the same time.
    """
    folder.mkdir(parents=True, exist_ok=True)
    free: SimpleQueue[EmulatedBench] = SimpleQueue()

    def cell(pair: tuple[str, str]) -> Cell:
        bench = free.get()
        reason = ""
        try:
            for trial in range(1, _TRIALS + 1):
                try:
                    return run(bench, *pair, folder if trial == 1 else folder / f"trial-{trial}")
                except RunError as error:
                    reason = str(error)
            return Cell(*pair, "not reached", None, reason)
        finally:
            free.put(bench)

    with ExitStack() as ends:
        for _ in range(at_once):
            free.put(ends.enter_context(EmulatedBench(SETTINGS, fmu, 30.0)))
        with ThreadPoolExecutor(at_once) as pool:
            return list(pool.map(cell, pairs))
