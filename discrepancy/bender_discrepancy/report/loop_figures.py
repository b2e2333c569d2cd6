"""A loop in the figures that people compare, read off the corrected model as it is driven slowly to and fro."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from bender_effects.catalogue import EFFECTS
from bender_inference.records.observations import Array
from bender_plant.blocks import BLOCKS, Block, calibration, linear_transduction
from bender_plant.model import Model

ROWS_OF_A_BRANCH = 500
STILL = 0.1
SLOW_S = 1e9
"""Of a step along a branch: what lags has arrived."""
"""A free stretch is one in which the reading moves by less than this part of the steepest slopes on either side of it,
and over which one of these slopes would have moved it by more than this part of its swing."""


@dataclass(frozen=True, slots=True)
class FreeStretch:
    """After a reversal the reading follows for a while, stands still for a while, and follows again.

    Attributes:
        after_V: from the reversal to the stretch, mean of both branches.
        length_V: of the stretch, mean of both branches.
    """

    after_V: float
    length_V: float


@dataclass(frozen=True, slots=True)
class Loop:
    """A loop between two voltages.

    Attributes:
        width_um: largest difference between the branches.
        remanence_um: what stays at 0 V after the upper voltage, reached from rest.
        free: stretch after each reversal, None where there is none.
    """

    width_um: float
    remanence_um: float
    free: FreeStretch | None


def loop_of(model: Model, low_V: float, high_V: float) -> Loop:
    """Return the loop of a model with an effect that is told as one between two voltages.

    Only what is told of slow voltages counts: transduction where it is linear, hysteresis, and what bends a reading
    behind them. Lags, modes and surroundings are left out.
    """
    swing = np.linspace(low_V, high_V, ROWS_OF_A_BRANCH)
    up = np.linspace(0.0, high_V, ROWS_OF_A_BRANCH)
    reading = _slow_readings(model, np.concatenate([up, up[::-1], up, swing[::-1], swing, swing[::-1]]))
    rising, falling = reading[-2 * swing.size : -swing.size], reading[-swing.size :]
    width = float(np.max(np.abs(rising - falling[::-1])))
    remanence = abs(float(reading[2 * up.size - 1] - reading[0]))
    return Loop(width, remanence, _both(_stretch(falling), _stretch(rising), swing))


def _slow_readings(model: Model, voltage_V: Array) -> Array:
    """Return the readings (n,) in um along voltages (n,) that begin at 0."""
    chain = [(block, constants, [block.initial(constants)]) for block, constants in _chain(model)]
    transducer = next((x for x in model.blocks if x.id == linear_transduction.ID), None)
    slope = 0.0 if transducer is None else linear_transduction.constants(transducer.parameters, model.beam)[0]
    gain = next((x.parameters.gain for x in model.blocks if x.id == calibration.ID), 1.0)
    readings, last = np.empty(voltage_V.size), 0.0
    for row, v in enumerate(voltage_V):
        course = (slope * last, 0.5 * slope * (last + v), slope * v)
        for block, constants, state in chain:
            beside = (last, 0.5 * (last + v), float(v)) if block.beside else ()
            assert block.step is not None
            state[0], *course = block.step(state[0], constants, 0.0, SLOW_S, *course, *beside)
        readings[row], last = course[-1], float(v)
    return gain * readings


def _chain(model: Model) -> Iterator[tuple[Block, Any]]:
    given = {x.id: x.parameters for x in model.blocks}
    known = [x for x in given if x in EFFECTS]
    loops = [x for x in known if EFFECTS[x].told_as == "loop"]
    for name in (*loops, *(x for x in known if EFFECTS[x].bends_slow_reading)):
        yield BLOCKS[name], BLOCKS[name].constants(given[name], model.beam)


def _stretch(reading: Array) -> slice | None:
    """Return the rows of the free stretch of a branch: where most is held back."""
    slope = np.diff(reading) * np.sign(reading[-1] - reading[0])
    before, behind = np.maximum.accumulate(slope), np.maximum.accumulate(slope[::-1])[::-1]
    beside = np.minimum(before, behind)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], slope < STILL * beside, [False]])))
    runs = [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    held_back = [(x.stop - x.start) * float(np.min(beside[x])) for x in runs]
    if not runs or max(held_back) < STILL * float(np.ptp(reading)):
        return None
    return runs[int(np.argmax(held_back))]


def _both(one: slice | None, other: slice | None, swing_V: Array) -> FreeStretch | None:
    if one is None or other is None:
        return None
    step_V = float(swing_V[1] - swing_V[0])
    after, length = one.start + other.start, one.stop - one.start + other.stop - other.start
    return FreeStretch(0.5 * step_V * after, 0.5 * step_V * length)
