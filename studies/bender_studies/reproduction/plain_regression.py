"""Plain sparse regression on the recording, as the paper did it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_identify.fitting.candidate import with_delay
from bender_identify.fitting.resimulation import Bank, score, with_transducer
from bender_identify.regression.plain_sindy import plain_sindy
from bender_identify.settings import LIBRARIES
from bender_loop.records.record import Record
from bender_plant.model import Model, ModelError
from bender_studies.reproduction.shared_work import SharedWork

Array = NDArray[np.float64]
TERMS = LIBRARIES["paper"]


@dataclass(frozen=True, slots=True, eq=False)
class PlainModel:
    """What plain regression found, and what it is worth re-simulated.

    Attributes:
        coefficients: by the terms of (30).
        readings_um: simulated at the rows of the recording, None where the equation runs away.
        fitted_percent: (29) on the rows that it was given, or words.
        held_out_percent: (29) on the others, or words.
        score_of_the_truth: (29) of equation (30) on the held-out rows.
    """

    coefficients: dict[str, float]
    readings_um: Array | None
    fitted_percent: float | str
    held_out_percent: float | str
    score_of_the_truth: float


def fit_plain_model(shared: SharedWork) -> PlainModel:
    """Learn from the fitted rows of the recording, score on both parts."""
    experiment = shared.identification.experiments[0]
    base = with_delay(shared.paper_model, shared.bench.delay_s)
    seen = experiment.fitted & np.isfinite(experiment.measured_um)
    seen[0] = False
    fitted = Record(experiment.time_s[seen], experiment.acting_V[seen], experiment.measured_um[seen])
    values = plain_sindy(TERMS, [fitted])
    bank = Bank([experiment])

    def percent(model: Model) -> tuple[Array, float, float]:
        readings = bank.run(model)
        scores = [score(pick(bank.measured()), pick(readings)) for pick in (bank.fitted, bank.held_out)]
        return readings[0], scores[0].equation_29_percent, scores[1].equation_29_percent

    truth = percent(base)[2]
    coefficients = dict(zip(TERMS, values.tolist(), strict=True))
    try:
        model = with_transducer(base, "sparse_equation", terms=TERMS, coefficients=tuple(values.tolist()))
        readings, on_fitted, on_held_out = percent(model)
    except (ArithmeticError, ModelError):
        return PlainModel(coefficients, None, "runs away", "runs away", truth)
    return PlainModel(coefficients, readings, on_fitted, on_held_out, truth)
