"""Commands that are a few sines: their lines are found, and no disturbance is sought there."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from bender_discrepancy.records.command_lines import command_lines_Hz


@given(
    st.lists(st.integers(0, 11), min_size=2, max_size=4, unique=True), st.integers(0, 10**6), st.floats(0.0, 1.0),
    st.sampled_from((200, 900, 3000)),
)  # fmt: skip
@examples(max_examples=40, deadline=None)
def test_a_few_sines_are_found_by_their_frequencies(places: list[int], seed: int, grows: float, rows: int) -> None:
    rng = np.random.default_rng(seed)
    # a few lines of a record apart, and slow beside the rows
    cycles = np.array([5.0 + 4.0 * k + rng.uniform(-0.8, 0.8) for k in places])
    time_s = np.linspace(0.0, 20.0, rows)
    waves = np.sin(2.0 * np.pi * np.outer(time_s, cycles / 20.0) + rng.uniform(0.0, 6.0, cycles.size))
    command = 25.0 + 10.0 * (1.0 - grows + grows * time_s / 20.0) * (waves @ rng.uniform(0.6, 1.0, cycles.size))
    found = np.sort(command_lines_Hz(time_s, command))
    assert found.size == cycles.size
    np.testing.assert_allclose(found, np.sort(cycles) / 20.0, atol=0.2 / 20.0)


@given(st.integers(0, 10**6), st.sampled_from((300, 1200)), st.integers(2, 30))
@examples(max_examples=40, deadline=None)
def test_levels_and_noise_have_no_lines(seed: int, rows: int, dwell: int) -> None:
    rng = np.random.default_rng(seed)
    command = rng.uniform(0.0, 50.0, rows // dwell + 1).repeat(dwell)[:rows]
    assert command_lines_Hz(np.arange(rows) / 30.0, command) == ()


@pytest.mark.parametrize("command", [np.zeros(300), np.full(300, 4.0), np.arange(20.0)])
def test_what_hardly_moves_or_is_short_has_no_lines(command: np.ndarray) -> None:
    assert command_lines_Hz(np.arange(command.size) / 30.0, command) == ()
