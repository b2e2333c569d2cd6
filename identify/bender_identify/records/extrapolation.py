"""A voltage that nobody recorded: how far apart the models are where no reading can judge them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive, Simulator
from bender_identify.fitting.candidate import Candidate
from bender_identify.fitting.resimulation import quasi_static, with_transducer
from bender_identify.records.experiment import Experiment
from bender_identify.records.voltage_path import even_times
from bender_identify.regression.equation_search import Learned
from bender_plant.model import Model

Array = NDArray[np.float64]

CYCLES, ROWS_PER_CYCLE = 8, 100
TONES = ((0.37, 0.5, 0.0), (1.7, 0.5, 1.0))
"""Frequency in units of the record's, share of the amplitude, phase."""
DRAWS = 20


@dataclass(frozen=True, slots=True)
class Unseen:
    """Distances on the two-tone voltage, in percent of the rms about the mean of the written model's motion.

    Attributes:
        rivals: distance of every other model, by its id; None where it ran away.
        coefficients: rms spread that the uncertain coefficients of the learned equation make, None if they ran away.
    """

    rivals: dict[str, float | None]
    coefficients: float | None


def two_tones(experiments: Sequence[Experiment]) -> Drive:
    """Return two tones, below and above the record's rate, within the voltages that were recorded."""
    low = min(float(x.acting_V.min()) for x in experiments)
    high = max(float(x.acting_V.max()) for x in experiments)
    cycle_s = cycle_of(experiments[0])
    time_s = even_times(cycle_s / ROWS_PER_CYCLE, CYCLES * ROWS_PER_CYCLE)
    tones = sum(a * np.sin(2.0 * np.pi * f * time_s / cycle_s + phase) for f, a, phase in TONES)
    return Drive.of_rows(time_s, 0.5 * (low + high) + 0.5 * (high - low) * np.asarray(tones), linear=True)


def cycle_of(experiment: Experiment) -> float:
    """Return the period, or what stands for it where nothing repeats."""
    excitation = experiment.excitation
    duration = float(experiment.time_s[-1] - experiment.time_s[0])
    return excitation.period_s or 2.0 * duration / max(excitation.turns, 4)


def compare_unseen(
    written: Candidate, candidates: Sequence[Candidate], learned: Learned, experiments: Sequence[Experiment],
    base: Model, rng: np.random.Generator,
) -> Unseen:  # fmt: skip
    """Simulate every candidate and draws of the learned coefficients on a voltage that was not recorded."""
    simulator = Simulator(two_tones(experiments))

    def run(model: Model) -> Array | None:
        try:
            reading = simulator.run(quasi_static(model)).reading_um
        except ArithmeticError:
            return None
        return reading - reading[0]

    reference = run(written.model)
    size = 0.0 if reference is None else float(np.std(reference))
    readings = {c.id: run(c.model) for c in candidates if c.id != written.id}
    rivals = {name: _distance(reading, reference, size) for name, reading in readings.items()}
    fit = learned.candidate.fit
    draws = rng.multivariate_normal(fit.values, _symmetric(fit.covariance[:-1, :-1]), size=DRAWS, method="eigh")
    centre = run(learned.candidate.model)
    spread = [
        _distance(
            run(with_transducer(base, "sparse_equation", terms=learned.terms, coefficients=tuple(map(float, draw)))),
            centre, size,
        )
        for draw in draws
    ]  # fmt: skip
    known = [x for x in spread if x is not None]
    return Unseen(rivals, float(np.sqrt(np.mean(np.square(known)))) if len(known) == DRAWS else None)


def _symmetric(covariance: Array) -> Array:
    return 0.5 * (covariance + covariance.T)


def _distance(reading: Array | None, reference: Array | None, size: float) -> float | None:
    if reading is None or reference is None or size == 0.0:
        return None
    return 100.0 * float(np.sqrt(np.mean((reading - reference) ** 2))) / size
