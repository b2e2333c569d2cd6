"""Rows in stretches and simulations side by side give what one run of the whole gives."""

import json
import multiprocessing
import threading
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from effect_examples import EXAMPLES
from few import few_rows
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_compiled.parallel_map import THREADS, parallel_map
from bender_compiled.simulation import Bounds, Drive, Simulator, own_bounds
from bender_compiled.stream import LOOKED_AT_S, MOST_PARTS, MOST_SUBSTEPS, Stream
from bender_plant.model import Model, load_model
from bender_plant.plant import Plant


@pytest.fixture
def threads(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    return lambda count: monkeypatch.setenv(THREADS, str(count))


def _slow_square(x: int) -> int:
    time.sleep(0.01 * (5 - x))
    return x * x


@pytest.mark.parametrize("count", [1, 2, 5])
def test_results_come_in_the_order_of_the_items_and_what_one_raises_is_raised(
    threads: Callable[[int], None], count: int
):
    threads(count)
    assert parallel_map(_slow_square, range(5)) == [0, 1, 4, 9, 16]
    with pytest.raises(ZeroDivisionError):
        parallel_map(lambda x: 1 / x, [1, 0, 2])


def test_items_overlap_in_time(threads: Callable[[int], None]):
    threads(2)
    meeting = threading.Barrier(2, timeout=10.0)
    assert sorted(parallel_map(lambda _: meeting.wait(), range(2))) == [0, 1]


def test_what_is_begun_within_a_thread_goes_on_in_it(threads: Callable[[int], None]):
    threads(2)

    def inner(_: int) -> set[str]:
        return set(parallel_map(lambda _: threading.current_thread().name, range(4)))

    assert all(len(names) == 1 for names in parallel_map(inner, range(4)))


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


PAPER = load_model("paper")
RNG = np.random.default_rng(11)
TIME = np.cumsum(RNG.uniform(0.002, 0.1, 60))
VOLTAGE = np.append(np.repeat(RNG.uniform(0.0, 50.0, 20), 3)[:-1], 0.0)


def in_stretches(stream: Stream, cuts: list[int], late_s: float = 0.0) -> np.ndarray:
    edges = [0, *sorted(set(cuts)), TIME.size]
    parts = [slice(a, b) for a, b in pairwise(edges) if b > a]
    return np.concatenate([stream.advance(TIME[x], VOLTAGE[x], TIME[x] + late_s) for x in parts], axis=1)


@pytest.mark.parametrize(
    ("block_id", "parameters"),
    few_rows(EXAMPLES, *range(0, len(EXAMPLES), 6)),
    ids=[f"{block_id} {k}" for k, (block_id, _) in enumerate(EXAMPLES)],
)
def test_stretches_give_the_whole_record(block_id: str, parameters: dict[str, Any]) -> None:
    model = PAPER.with_block(block_id, **parameters)
    whole = Simulator(Drive.of_rows(TIME, VOLTAGE, TIME + 0.001)).run(model).reading_um
    found = in_stretches(Stream((model,)), [1, 2, 17, 40], 0.001)[0]
    assert np.max(np.abs(found - whole)) < 1e-9


@pytest.mark.slow
@settings(max_examples=15)
@given(st.lists(st.integers(1, TIME.size - 1), max_size=6), st.booleans())
def test_several_models_do_not_disturb_one_another(cuts: list[int], linear: bool) -> None:
    models = (
        PAPER,
        PAPER.with_block("creep", gains=(0.1,), time_constants_s=(1.0,)),
        PAPER.with_block("transport_delay", delay_s=0.03),
        PAPER.with_block("backlash", half_width_um=0.5),
    )
    stream = Stream(models, linear=linear)
    found = in_stretches(stream, cuts)
    bounds = stream.bounds
    for k, model in enumerate(models):
        drive = Drive.of_rows(TIME, VOLTAGE, linear=linear)
        alone = Simulator(drive, Bounds(bounds.first_s, bounds.longest_s, bounds.growth)).run(model).reading_um
        assert np.max(np.abs(found[k] - alone)) < 1e-9


def test_a_saved_state_goes_on_to_the_same_bits() -> None:
    models = (
        PAPER,
        PAPER.with_block("transport_delay", delay_s=0.05),
        PAPER.with_block("slew_limit", slew_rate_V_per_s=90.0),
    )
    one, other = Stream(models), Stream(models)
    one.advance(TIME[:30], VOLTAGE[:30])
    other.restore(json.loads(json.dumps(one.state())))
    further = TIME[30:], VOLTAGE[30:]
    assert np.array_equal(one.advance(*further), other.advance(*further))


def test_the_state_of_other_models_is_refused() -> None:
    saved = Stream((PAPER,)).state()
    with pytest.raises(ValueError, match="other models"):
        Stream((PAPER.with_block("backlash", half_width_um=0.5),)).restore(saved)


def test_a_device_that_stood_at_a_voltage_reads_what_it_stood_at() -> None:
    stream, plant = Stream((PAPER,)), Plant(PAPER)
    stream.begin(-100.0, 20.0)
    state, stood, _ = plant.step(plant.initial(), 20.0, -100.0, 100.0)
    moved = plant.step(state, 30.0, 0.0, 0.1)[1]
    found = stream.advance(np.array([0.0, 0.1]), np.array([30.0, 30.0]))[0]
    assert found == pytest.approx([stood, moved], abs=1e-9)


@pytest.mark.parametrize(
    "model", [PAPER, PAPER.with_block("creep", gains=(0.1,), time_constants_s=(50.0,))], ids=["forgets", "creeps"]
)
def test_a_device_that_stands_reads_as_if_it_had_been_driven_all_the_time(model: Model) -> None:
    driven, stood = Stream((model,)), Stream((model,))
    driven.begin(-300.0, 20.0)
    stood.stand(-300.0, 20.0, 0.0)
    rows = np.array([0.0, 0.1, 0.2]), np.array([30.0, 10.0, 10.0])
    assert stood.advance(*rows) == pytest.approx(driven.advance(*rows), abs=1e-9)


def test_longer_sub_steps_miss_little() -> None:
    fine, coarse = (in_stretches(Stream((PAPER,), coarser=x), [])[0] for x in (1.0, 16.0))
    assert 0.0 < np.max(np.abs(fine - coarse)) < 1e-2
    assert own_bounds(PAPER, 16.0).longest_s > own_bounds(PAPER).longest_s


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("pause_s", [500.0, 3000.0])
def test_a_device_stands_through_a_pause(pause_s: float, linear: bool) -> None:
    """As if rows of the pause had come: the same command, and before the next row a straight way to it."""
    models = (PAPER, PAPER.with_block("creep", gains=(0.1,), time_constants_s=(200.0,)))
    before = TIME[-1] + pause_s + TIME[0] - LOOKED_AT_S
    waiting = np.arange(TIME[-1] + 10.0, before, 10.0)
    later, commands = TIME[-1] + pause_s + TIME, VOLTAGE + 5.0
    paused, driven = Stream(models, linear), Stream(models, linear)
    paused.advance(TIME, VOLTAGE)
    found = paused.advance(later, commands)
    driven.advance(TIME, VOLTAGE)
    driven.advance(np.append(waiting, before), np.full(waiting.size + 1, VOLTAGE[-1]))
    assert found == pytest.approx(driven.advance(later, commands), abs=1e-7)


@pytest.mark.parametrize("pause_s", [1e5, 1e8])
def test_no_pause_asks_for_more_than_is_driven_at_once(pause_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: list[int] = []
    cut = Stream._grid  # pyright: ignore[reportPrivateUsage]

    def counted(stream: Stream, feed: Any, rows_s: np.ndarray) -> Any:
        assert rows_s[-1] - rows_s[0] < 1e4
        signal = cut(stream, feed, rows_s)
        sizes.append(signal.h.size)
        return signal

    monkeypatch.setattr(Stream, "_grid", counted)
    stream = Stream((PAPER.with_block("creep", gains=(0.1,), time_constants_s=(1e4,)),))
    stream.advance(TIME, VOLTAGE)
    stream.advance(TIME[-1] + pause_s + TIME, VOLTAGE)
    assert max(sizes) <= 1.1 * MOST_SUBSTEPS
    assert sum(sizes) <= 1.1 * MOST_SUBSTEPS * MOST_PARTS
