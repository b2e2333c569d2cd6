"""A linear stand-in with a slow copy of what it shows: a pole and a zero more, for an FMU that no chain follows.

Lags and modes of a first model stand one behind the other. A plant of two stores that is read at the first one has a
zero between its poles: its answer is a quick one and a slow one side by side, as `creep` has it, w + g x with
tau x' = w - x.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bender_compiled.simulation import Simulator
from bender_inference.fitting.own_numbers import own_form
from bender_inference.records.observations import observe
from bender_loop.records.drive import InputHold
from bender_loop.records.record import Record
from bender_plant.blocks import calibration, creep, linear_transduction
from bender_plant.model import BlockSettings, Model
from bender_plant.parameter import ModelError

Array = NDArray[np.float64]

STARTS = ((0.1, -0.5), (10.0, 1.0))
"""Time constant over that of the model, and size, of the copy."""
MOST_EVALUATIONS, COARSER = 40, 3.0
FAR_OFF = 1e3
"""Of the spread: what cannot be simulated."""


def with_slow_copy(model: Model, runs: Sequence[tuple[Record, Array]], hold: InputHold) -> Model | None:
    """Return a linear model with a slow copy, fitted to runs of an FMU; None where it has no time of its own.

    Args:
        model: of lags or modes.
        runs: what drove the FMU, and what it showed.
        hold: the command between two rows.
    """
    own = own_form(model)
    times = [x for block in model.blocks if block.id == "plant_lag" for x in (block.parameters.time_constant_s,)]
    if own is None or not times:
        return None
    simulators = [
        Simulator(observe(x, hold != "hold", False, hold == "smooth").drive, coarser=COARSER) for x, _ in runs
    ]
    scale = max(float(np.std(np.concatenate([y for _, y in runs]))), 1e-300)

    def at(x: Array) -> Model:
        moved = own.apply(model, tuple(f.outward(float(p)) for f, p in zip(own.free, x[2:], strict=True)))
        copies = creep.Parameters((float(x[0]),), (math.exp(float(x[1])),))
        return _with(moved, BlockSettings(creep.ID, copies))

    def residual(x: Array) -> Array:
        try:
            readings = [s.run(at(x)).reading_um for s in simulators]
        except (ModelError, ArithmeticError):
            return np.full(sum(y.size for _, y in runs), FAR_OFF)
        line = _line(readings, runs)
        return (
            np.concatenate([y - line[0] * r - c for (_, y), r, c in zip(runs, readings, line[1:], strict=True)]) / scale
        )

    given = [f.inward(f.starts[0]) for f in own.free]
    found = [
        least_squares(
            residual, np.array([size, math.log(factor * times[0]), *given]), x_scale="jac", max_nfev=MOST_EVALUATIONS,
            diff_step=1e-6,
        )
        for factor, size in STARTS
    ]  # fmt: skip
    best = min(found, key=lambda x: float(x.cost))
    try:
        fitted = at(best.x)
        readings = [s.run(fitted).reading_um for s in simulators]
    except (ModelError, ArithmeticError):
        return None
    gain, offset, *_ = _line(readings, runs)
    return _scaled(fitted, gain, offset)


def _line(readings: Sequence[Array], runs: Sequence[tuple[Record, Array]]) -> list[float]:
    """Return the gain of all runs and the offset of each."""
    record = np.concatenate([np.full(r.size, k) for k, r in enumerate(readings)])
    basis = np.column_stack([np.concatenate(readings), *[(record == k).astype(float) for k in range(len(runs))]])
    return np.linalg.lstsq(basis, np.concatenate([y for _, y in runs]), rcond=None)[0].tolist()


def _with(model: Model, block: BlockSettings) -> Model:
    return Model(model.name, model.beam, (*(x for x in model.blocks if x.id != block.id), block), model.description)


def _scaled(model: Model, gain: float, offset_um: float) -> Model:
    """Return a model whose readings are so many times as large, from its rest on."""
    before = next((x.parameters for x in model.blocks if x.id == calibration.ID), calibration.Parameters())
    assert isinstance(before, calibration.Parameters)
    transducer = next(x.parameters for x in model.blocks if x.id == linear_transduction.ID)
    sensitivity = linear_transduction.constants(transducer, model.beam)[0]
    moved = linear_transduction.Parameters(sensitivity_um_per_V=gain * sensitivity)
    first = _with(model, BlockSettings(linear_transduction.ID, moved))
    scale = calibration.Parameters(before.gain, gain * before.offset_um + offset_um)
    return _with(first, BlockSettings(calibration.ID, scale))
