"""What the records cannot tell: collinear terms, and coefficients that the output hardly sees."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bender_identify.fitting.resimulation import Bank
from bender_identify.records.experiment import Experiment
from bender_identify.regression.equation_search import Learned
from bender_identify.regression.rates import conditioning
from bender_identify.regression.terms import evaluated

WEAK = 0.3
"""A coefficient that can move by more than this part before the output moves by 1 % is weakly identified."""
TRADED = 0.2


@dataclass(frozen=True, slots=True)
class Identifiability:
    """What the excitation allows to learn.

    Attributes:
        condition_library: condition number of the whole library, columns of unit length, on simulated signals (noise
            would hide collinear columns); infinite where two columns are the same.
        condition_output: the same of the output's derivatives to the coefficients of the equation.
        twins: (term left out, term that does the same) pairs.
        weak: terms whose coefficient the output hardly sees, weakest first.
        traded: terms whose coefficients can move together with the least effect.
    """

    condition_library: float
    condition_output: float
    twins: tuple[tuple[str, str], ...]
    weak: tuple[str, ...]
    traded: tuple[str, ...]


def examine(learned: Learned, experiments: Sequence[Experiment]) -> Identifiability:
    """Examine the library and the equation on the fitted rows."""
    bank = Bank(experiments, quick=True)
    offset = learned.candidate.fit.offset_um
    simulated = [y - offset for y in bank.run(learned.candidate.model)]
    rate = [np.gradient(x.acting_V, x.time_s) for x in experiments]
    w, u, r = bank.fitted(simulated), bank.fitted([x.acting_V for x in experiments]), bank.fitted(rate)
    columns = np.column_stack([evaluated(term, w, u, r) for term in learned.library])
    jacobian = learned.candidate.fit.jacobian * learned.candidate.fit.values
    condition_output, _, vectors = conditioning(jacobian - jacobian.mean(axis=0))
    coefficients = learned.candidate.coefficients
    weak = sorted((c for c in coefficients if c.slack is None or c.slack > WEAK), key=lambda c: -(c.slack or np.inf))
    together = np.abs(vectors[-1])
    return Identifiability(
        condition_library=conditioning(columns)[0],
        condition_output=condition_output,
        twins=learned.regression.twins,
        weak=tuple(c.name for c in weak),
        traded=tuple(term for term, x in zip(learned.terms, together, strict=True) if x > TRADED),
    )
