"""A fitted model of hysteresis, whatever its form."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bender_identify.fitting.output_error import OutputFit
from bender_identify.fitting.resimulation import Bank, Score, score
from bender_identify.records.experiment import Experiment
from bender_plant.model import Model

NOTHING_UM = 1e-9


@dataclass(frozen=True, slots=True)
class Coefficient:
    """One number of a model.

    Attributes:
        name: the term it multiplies, or its symbol.
        value: in `unit`.
        std: standard deviation from the residual, its correlation and what of it comes back in every cycle; None where
            it was not estimated.
        half_width: of the interval; all intervals of a model hold together with 95 % probability (Bonferroni).
        unit: in um, V and s.
        slack: relative change that the others can make up for until the output has moved by 1 % of its rms about
            the mean; a large one means that this input hardly sees the coefficient. None where not estimated.
    """

    name: str
    value: float
    unit: str
    std: float | None = None
    half_width: float | None = None
    slack: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A model of hysteresis with all that a reader needs to judge it.

    Attributes:
        id: as in `settings.KEEP`.
        title: a few words.
        equation: what it says, one line.
        model: ready to be written.
        coefficients: its numbers.
        parameters: how many numbers were fitted, the offset included.
        fit: the output-error fit behind it.
        refit: fits the same structure to other rows.
    """

    id: str
    title: str
    equation: str
    model: Model
    coefficients: tuple[Coefficient, ...]
    parameters: int
    fit: OutputFit
    refit: Callable[[Sequence[Experiment]], "Candidate"]


def with_offset(model: Model, offset_um: float) -> Model:
    """Return the model with a constant added to its reading."""
    calibration = next((s.parameters for s in model.blocks if s.id == "calibration"), None)
    gain, before_um = (1.0, 0.0) if calibration is None else (calibration.gain, calibration.offset_um)
    offset_um = 0.0 if abs(offset_um) < NOTHING_UM else offset_um
    return model.with_block("calibration", gain=gain, offset_um=before_um + offset_um)


def with_delay(model: Model, delay_s: float) -> Model:
    """Return the model with a transport delay; with none it stays as it is."""
    return model.with_block("transport_delay", delay_s=delay_s) if delay_s > 0.0 else model


def described(names: Sequence[str], units: Sequence[str], fit: OutputFit) -> tuple[Coefficient, ...]:
    """Return the parameters of an output-error fit with what is known of each."""
    from scipy.stats import norm

    count = len(names)
    factor = float(norm.isf(0.025 / max(count, 1)))
    std = np.sqrt(fit.repeating_factor * np.maximum(np.diag(fit.covariance)[:count], 0.0))
    slack = _slack(fit)
    return tuple(
        Coefficient(names[k], float(fit.values[k]), units[k], float(std[k]), float(factor * std[k]), slack[k])
        for k in range(count)
    )


def _slack(fit: OutputFit) -> list[float | None]:
    """Return for each parameter the relative change that moves the output by 1 % when the others make up for it."""
    columns = fit.jacobian - fit.jacobian.mean(axis=0)
    output = _motion(fit)
    found: list[float | None] = []
    for k in range(columns.shape[1]):
        others = np.delete(columns, k, axis=1)
        own = columns[:, k]
        if others.shape[1]:
            size = np.linalg.norm(others, axis=0)
            others = others / np.where(size > 0.0, size, 1.0)
            own = own - others @ np.linalg.lstsq(others, own, rcond=1e-12)[0]
        moved = float(np.linalg.norm(own)) * abs(float(fit.values[k]))
        found.append(0.01 * output / moved if moved > 0.0 else None)
    return found


def _motion(fit: OutputFit) -> float:
    return float(np.linalg.norm(fit.output_um - fit.output_um.mean()))


def scores(candidate: Candidate, experiments: Sequence[Experiment]) -> tuple[Score | None, Score | None]:
    """Return the scores of the whole simulated model on the fitted and on the held-out rows."""
    bank = Bank(experiments)
    readings = bank.run(candidate.model)
    found = []
    for pick in (bank.fitted, bank.held_out):
        measured = pick(bank.measured())
        found.append(score(measured, pick(readings)) if measured.size else None)
    return found[0], found[1]
