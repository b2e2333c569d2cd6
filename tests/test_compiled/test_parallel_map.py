"""Simulations side by side: the same results in the same order, however many threads there are."""

import multiprocessing
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from bender_compiled.parallel_map import THREADS, parallel_map
from bender_compiled.simulation import Drive, Simulator
from bender_plant.model import load_model


@pytest.fixture
def threads(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    return lambda count: monkeypatch.setenv(THREADS, str(count))


def _slow_square(x: int) -> int:
    time.sleep(0.01 * (5 - x))
    return x * x


@pytest.mark.parametrize("count", [1, 2, 5])
def test_results_come_in_the_order_of_the_items(threads: Callable[[int], None], count: int):
    threads(count)
    assert parallel_map(_slow_square, range(5)) == [0, 1, 4, 9, 16]


def test_items_overlap_in_time(threads: Callable[[int], None]):
    threads(2)
    meeting = threading.Barrier(2, timeout=10.0)
    assert sorted(parallel_map(lambda _: meeting.wait(), range(2))) == [0, 1]


def test_what_is_begun_within_a_thread_goes_on_in_it(threads: Callable[[int], None]):
    threads(2)

    def inner(_: int) -> set[str]:
        return set(parallel_map(lambda _: threading.current_thread().name, range(4)))

    assert all(len(names) == 1 for names in parallel_map(inner, range(4)))


def test_what_an_item_raises_is_raised(threads: Callable[[int], None]):
    threads(2)
    with pytest.raises(ZeroDivisionError):
        parallel_map(lambda x: 1 / x, [1, 0, 2])


@pytest.mark.parametrize("count", [2, 4])
def test_one_simulator_in_several_threads_gives_the_numbers_of_one(threads: Callable[[int], None], count: int):
    time_s = np.arange(300) / 30
    drive = Drive.of_rows(time_s, 25.0 + 20.0 * np.sin(1.7 * time_s))
    base = load_model("beam")
    # as many stages as are kept, and some that are dropped
    models = [base.with_block("source_resistance", time_constant_s=1e-3 * (1 + k % 7)) for k in range(40)]
    one_by_one = [Simulator(drive, keep_substeps=20_000).run(model).reading_um for model in models]
    threads(count)
    shared = Simulator(drive, keep_substeps=20_000)
    found = parallel_map(lambda model: shared.run(model).reading_um, models)
    assert all(np.array_equal(x, y) for x, y in zip(found, one_by_one, strict=True))
    work = Simulator(drive)
    for model in models:
        work.run(model)
    assert shared.simulated == work.simulated


def _in_a_child(sending) -> None:
    sending.send(parallel_map(_slow_square, range(4)))


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="needs fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_process_begins_threads_of_its_own(threads: Callable[[int], None]):
    threads(2)
    parallel_map(_slow_square, range(4))
    receiving, sending = multiprocessing.get_context("fork").Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(target=_in_a_child, args=(sending,))
    child.start()
    assert receiving.poll(20.0)
    assert receiving.recv() == [0, 1, 4, 9]
    child.join(10.0)
    assert child.exitcode == 0
