"""Rows in stretches of any length give what the whole record gives, and what was saved goes on from there."""

import json
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from effect_examples import EXAMPLES
from few import few_rows
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_compiled.simulation import Bounds, Drive, Simulator, own_bounds
from bender_compiled.stream import Stream
from bender_plant.model import load_model
from bender_plant.plant import Plant

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
@settings(max_examples=15, deadline=None)
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


def test_longer_sub_steps_miss_little() -> None:
    fine, coarse = (in_stretches(Stream((PAPER,), coarser=x), [])[0] for x in (1.0, 16.0))
    assert 0.0 < np.max(np.abs(fine - coarse)) < 1e-2
    assert own_bounds(PAPER, 16.0).longest_s > own_bounds(PAPER).longest_s
