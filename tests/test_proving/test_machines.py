"""Machines of other fields: the same seed gives the same machine, and each lacks what it is said to lack."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_effects.catalogue import EFFECTS
from bender_proving.machines import MACHINES, draw

KINDS = range(len(MACHINES))


@settings(max_examples=5)
@given(st.integers(0, 10_000))
def test_a_seed_gives_two_records_and_always_the_same(seed: int):
    one, again = draw(seed), draw(seed)
    for number in (0, 1):
        assert one.reading[number].tobytes() == again.reading[number].tobytes()
        assert np.all(np.isfinite(one.reading[number]))
        assert np.all(np.diff(one.time_s[number]) > 0.0)
        assert np.ptp(one.reading[number]) > 0.0
    assert one.drive[0].shape == one.reading[0].shape
    assert one.reading[0].tobytes() != one.reading[1].tobytes()


@pytest.mark.parametrize("kind", KINDS, ids=[x.name for x in MACHINES])
def test_names_are_those_of_the_catalogue_and_no_right_one_is_wrong(kind: int):
    machine = MACHINES[kind]
    assert machine.right | machine.wrong <= set(EFFECTS)
    assert not machine.right & machine.wrong


@pytest.mark.parametrize("kind", KINDS, ids=[x.name for x in MACHINES])
def test_no_machine_answers_twice_the_input_with_twice_the_reading(kind: int):
    machine = MACHINES[kind]
    respond = machine.draw(np.random.default_rng(kind))
    time_s = machine.row_s * np.arange(400, dtype=np.float64)
    wave = np.sign(np.sin(2.0 * np.pi * np.arange(400) / 130.0))
    rest, small, large = (
        respond(time_s, machine.centre + size * machine.span * wave) for size in (0.0, 0.25, 0.5)
    )  # fmt: skip
    extent = float(np.ptp(large - rest))
    assert np.max(np.abs((large - rest) - 2.0 * (small - rest))) > 0.005 * extent
