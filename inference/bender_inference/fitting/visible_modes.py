"""Modes that no reading shows: in a search they follow the drive at once, as those above the last one of a model do.

A mode whose ringing is over before the next reading, or too small for it, costs sub-steps of a tenth of its period as
soon as a lag or a play stands behind it. What is searched is then the same model with fewer modes; what is written in
the end is the model as given.
"""

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from bender_inference.fitting.fit_problem import Calibration, FitProblem, problem_of
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.records.noise import noise_floor_um
from bender_inference.records.observations import Array, Observations
from bender_plant.blocks import bending_modes
from bender_plant.model import Model, ModelError

# part of the noise that the modes which are left out may change the readings by, rms
UNSEEN = 0.1


def without_unseen_modes(base: Model, observations: Sequence[Observations]) -> Model:
    """Return the model with as few bending modes as the readings show; the model itself where they show all.

    Args:
        base: the model as given.
        observations: records of one bench.
    """
    modes = next((x.parameters for x in base.blocks if x.id == bending_modes.ID), None)
    if not isinstance(modes, bending_modes.Parameters) or modes.count == 1:
        return base
    problem = problem_of(base, tuple(observations))
    full = problem.readings(Hypothesis())
    if full is None:
        return base
    calibration = problem.calibrate(full)
    limits = [UNSEEN * x for x in _noise_um(problem, full, calibration)]
    for count in range(1, modes.count):
        fewer = base.with_block(bending_modes.ID, **(asdict(modes) | {"count": count}))
        changes = _changes_um(fewer, problem, full, calibration.gain)
        if changes and all(x < limit for x, limit in zip(changes, limits, strict=True)):
            return fewer
    return base


def _noise_um(problem: FitProblem, readings: list[Array], calibration: Calibration) -> list[float]:
    residuals = problem.residuals(readings, calibration)
    return [noise_floor_um(r, x.usable) for r, x in zip(residuals, problem.observations, strict=True)]


def _changes_um(fewer: Model, problem: FitProblem, full: list[Array], gain: float) -> list[float]:
    """Return by how much the readings of every record change, rms; none where the model cannot be simulated."""
    try:
        runs = [simulator.run(fewer).reading_um for simulator in problem.fine]
    except (ModelError, ArithmeticError):
        return []
    return [abs(gain) * float(np.sqrt(np.mean((a - b) ** 2))) for a, b in zip(runs, full, strict=True)]
