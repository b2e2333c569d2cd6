"""Models re-simulated over experiments: the only thing that they are judged by."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Bounds, Drive, Simulator
from bender_identify.records.experiment import Experiment
from bender_plant.blocks import BLOCKS
from bender_plant.model import BlockSettings, Model

Array = NDArray[np.float64]


KEPT_STRIDES, KEPT_SUBSTEPS = 5, 50
"""What a simulator keeps, in sub-steps for each command of its drive."""
COARSER = 6.0
RINGING = 5e-3
"""The structure counts in a search where it moves the readings by more than this part of their spread."""


class Bank:
    """Simulators of several experiments.

    `quick` is made for searches: it ends with the last fitted row and takes coarse steps. Unless `rings`, it leaves out
    the structure too (its modes ring far above the rates of hysteresis), and then steps from row to row where the
    chain allows it.
    """

    def __init__(self, experiments: Sequence[Experiment], quick: bool = False, rings: bool = False) -> None:
        self.experiments = tuple(experiments)
        self._still = quick and not rings
        drives = [_to_last_fitted(x) if quick else x.drive for x in self.experiments]
        coarser = COARSER if quick else 1.0
        strides = Bounds(math.inf, math.inf)
        self._whole = [Simulator(x, None, coarser, KEPT_SUBSTEPS * len(x.voltage_V)) for x in drives]
        self._strides = [Simulator(x, strides, keep_substeps=KEPT_STRIDES * len(x.voltage_V)) for x in drives]

    def run(self, model: Model) -> list[Array]:
        """Return the readings in um of each experiment at the rows of its record, NaN after the end of a quick run.

        Raises:
            ArithmeticError: the model ran away.
        """
        if self._still:
            model = quasi_static(model)
        simulators = self._strides if self._still and _strides_over(model) else self._whole
        pairs = zip(simulators, self.experiments, strict=True)
        return [_padded(simulator.run(model).reading_um, x) for simulator, x in pairs]

    def fitted(self, readings: Sequence[Array]) -> Array:
        """Return the fitted rows of all experiments in one array."""
        return np.concatenate([y[x.fitted] for y, x in zip(readings, self.experiments, strict=True)])

    def held_out(self, readings: Sequence[Array]) -> Array:
        """Return the held-out rows of all experiments in one array."""
        return np.concatenate([y[x.held_out] for y, x in zip(readings, self.experiments, strict=True)])

    def measured(self) -> list[Array]:
        """Return the readings that were taken."""
        return [x.measured_um for x in self.experiments]


def search_bank(experiments: Sequence[Experiment], base: Model) -> Bank:
    """Return the quick bank for fits on a base model, with its structure where the voltage makes that ring."""
    plain = with_transducer(base, "sparse_equation", terms=("u'",), coefficients=(1.0,))
    still = Bank(experiments, quick=True)
    ringing = Bank(experiments, quick=True, rings=True)
    at_once, really = still.fitted(still.run(plain)), ringing.fitted(ringing.run(plain))
    return ringing if float(np.std(really - at_once)) > RINGING * float(np.std(at_once)) else still


def _to_last_fitted(experiment: Experiment) -> Drive:
    rows = np.flatnonzero(experiment.fitted)
    count = experiment.lead_rows + (int(rows[-1]) + 1 if rows.size else 1)
    return replace(experiment.rough_drive, row_time_s=experiment.rough_drive.row_time_s[: max(count, 2)])


def _padded(reading_um: Array, experiment: Experiment) -> Array:
    whole = np.full(len(experiment.time_s), np.nan)
    own = reading_um[experiment.lead_rows :]
    whole[: len(own)] = own
    return whole


def quasi_static(model: Model) -> Model:
    """Return the model without its structure and what follows, the calibration apart."""
    late = ("structure", "surroundings", "sensor")
    kept = tuple(s for s in model.blocks if BLOCKS[s.id].stage not in late or s.id == "calibration")
    return replace(model, blocks=kept)


def _strides_over(model: Model) -> bool:
    """Whether a step from row to row is as good as a short one: nothing in the chain makes a curve of the voltage."""
    straight = ("supply_quantisation", "transport_delay", "calibration")
    return all(BLOCKS[s.id].transducer or s.id in straight for s in model.blocks)


def with_transducer(base: Model, block_id: str, **parameters: object) -> Model:
    """Return the base model with another transducer and none of the material blocks beside the old one."""
    kept = tuple(s for s in base.blocks if BLOCKS[s.id].stage != "material")
    return replace(base, blocks=(*kept, BlockSettings(block_id, BLOCKS[block_id].parameters(**parameters))))


@dataclass(frozen=True, slots=True)
class Score:
    """How far a simulation is from the readings.

    Attributes:
        rms_um: root of the mean square.
        error_percent: the same over the rms of the readings about their mean.
        equation_29_percent: the paper's (29), the same over the rms of the readings themselves.
    """

    rms_um: float
    error_percent: float
    equation_29_percent: float


def score(measured_um: Array, simulated_um: Array) -> Score:
    """Score finite readings of shape (n,), n > 0."""
    rms_um = _rms(measured_um - simulated_um)
    return Score(rms_um, _percent(rms_um, measured_um - measured_um.mean()), _percent(rms_um, measured_um))


def _percent(rms_um: float, reference_um: Array) -> float:
    size_um = _rms(reference_um)
    return 100.0 * rms_um / size_um if size_um > 0.0 else math.inf


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(values * values)))
