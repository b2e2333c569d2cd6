"""A block cut at its own corners: along ramps, halved sub-steps give what whole ones do, at their ends and on average.

A held command turns nothing inside a sub-step of most blocks, so that steps do not show a `corner` that is missing.
"""

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_examples import EXAMPLES

from bender_plant.blocks import BLOCKS, Block
from bender_plant.model import load_model

BEAM = load_model("paper").beam
TRIANGLE = np.concatenate((np.arange(-61.3, 62.0, 0.61), np.arange(60.7, -62.0, -0.67), np.arange(-61.1, 40.0, 0.61)))
"""Ends of the sub-steps in V or um: they fall on no round number, and elsewhere on each way."""
LONGEST_S = 1e-3
BEGIN_S = 1.0
LARGEST_um = 1.2e-3
WITHOUT = {
    "sensor_quantisation": "a staircase: its average is no matter of a few corners",
    "residual_equation": "cut off outside of what it was learned from, where it is worth nothing anyway",
}
BY_STEP = [
    pytest.param(block_id, parameters, id=f"{block_id} {k}")
    for k, (block_id, parameters) in enumerate(EXAMPLES)
    if BLOCKS[block_id].step and block_id not in WITHOUT
]


def through(
    block: Block, constants: Any, state: Any, time_s: float, step_s: float, first: float, last: float
) -> tuple[Any, float, float]:
    """Return the state, the signal and its integral after a straight piece, cut at the corners of the block."""
    assert block.step is not None
    piece = (first, 0.5 * (first + last), last)
    beside = piece if block.beside else ()
    share = block.corner(state, constants, step_s, *piece, *beside) if block.corner else 1.0
    if share < 1.0:
        here = first + share * (last - first)
        state, _, before = through(block, constants, state, time_s, share * step_s, first, here)
        rest_s = step_s - share * step_s
        state, end, after = through(block, constants, state, time_s + share * step_s, rest_s, here, last)
        return state, end, before + after
    state, y0, ym, y1 = block.step(state, constants, time_s, step_s, *piece, *beside)
    return state, y1, step_s * (y0 + 4.0 * ym + y1) / 6.0


def along(block: Block, parameters: dict[str, Any], parts: int) -> np.ndarray:
    """Return the signal at the end of every sub-step and its average over it, each cut into so many parts."""
    settings = block.parameters(**parameters)
    constants = block.constants(settings, BEAM)
    step_s = min(LONGEST_S, *block.longest_step_s(settings, BEAM), block.ringing_step_s(settings, BEAM))
    state, found = block.initial(constants), []
    for k, (first, last) in enumerate(itertools.pairwise(TRIANGLE)):
        ends, y, area = np.linspace(first, last, parts + 1), 0.0, 0.0
        for part, (a, b) in enumerate(itertools.pairwise(ends)):
            time_s = BEGIN_S + (k + part / parts) * step_s
            state, y, more = through(block, constants, state, time_s, step_s / parts, float(a), float(b))
            area += more
        found.append((y, area / step_s))
    return np.array(found)


def largest_difference(block: Block, parameters: dict[str, Any]) -> float:
    return float(np.max(np.abs(along(block, parameters, 1) - along(block, parameters, 2))))


@pytest.mark.parametrize(("block_id", "parameters"), BY_STEP)
def test_halving_a_ramp_changes_nothing(block_id: str, parameters: dict[str, Any]) -> None:
    assert largest_difference(BLOCKS[block_id], parameters) < LARGEST_um, "is a corner missing?"


@pytest.mark.parametrize("block_id", ["dead_zone", "slew_limit", "backlash", "output_limit", "asymmetric_gain"])
def test_a_corner_that_is_missing_shows(block_id: str) -> None:
    assert largest_difference(replace(BLOCKS[block_id], corner=None), dict(reversed(EXAMPLES))[block_id]) > LARGEST_um
