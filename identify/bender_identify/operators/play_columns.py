"""Plays, powers of the voltage and their slow copies, each simulated once: the columns of a linear fit."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bender_identify.fitting.resimulation import Bank, with_transducer
from bender_plant.model import Model

Array = NDArray[np.float64]

DEGREES = (2, 3)


class PlayColumns:
    """Fitted rows of every linear part, each simulated through the whole chain once, with their slow copies.

    What is solved is small: the rows are replaced by the triangular factor of all columns with the readings beside.
    """

    def __init__(self, bank: Bank, base: Model, thresholds_V: Sequence[float], taus_s: Sequence[float]) -> None:
        self.thresholds_V, self.taus_s = tuple(thresholds_V), tuple(taus_s)
        self.names = ["u", *(f"F {r}" for r in thresholds_V), *(f"u^{n}" for n in DEGREES)]
        models = [with_transducer(base, "sparse_equation", terms=("u'",), coefficients=(1.0,))]
        models += [
            with_transducer(
                base, "prandtl_ishlinskii", linear_gain_um_per_V=0.0, thresholds_V=(r,), weights_um_per_V=(1.0,)
            )
            for r in thresholds_V
        ]
        models += [
            with_transducer(base, "sparse_equation", terms=(f"u^{n - 1} u'",), coefficients=(float(n),))
            for n in DEGREES
        ]
        nothing = with_transducer(base, "sparse_equation", terms=("u'",), coefficients=(0.0,))
        still = bank.fitted(bank.run(nothing))
        plain = [bank.fitted(bank.run(model)) - still for model in models]
        slow = [
            [bank.fitted(bank.run(creeping(model, (1.0,), (tau,)))) - still - here for tau in taus_s]
            for model, here in zip(models, plain, strict=True)
        ]
        self.measured = bank.fitted(bank.measured())
        self.still = still
        parts = np.array([[here, *behind] for here, behind in zip(plain, slow, strict=True)])
        self.shape = parts.shape[:2]
        self.whole = np.column_stack([parts.reshape(-1, len(still)).T, np.ones(len(still))])
        size = np.linalg.norm(self.whole, axis=0)
        size[size == 0.0] = 1.0
        factor = np.asarray(np.linalg.qr(np.column_stack([self.whole / size, self.measured - still]), mode="r"))
        self.factor: Array = factor[:, :-1] * size
        self.reading: Array = factor[:, -1]
        self.rises = float(np.corrcoef(plain[0], self.measured)[0, 1]) >= 0.0

    def mixed(self, gains: Array) -> Array:
        """Return the factor's columns of every part, its slow copies added with these gains."""
        return self.factor[:, :-1].reshape(-1, *self.shape) @ np.concatenate([[1.0], gains])

    def slowed(self, weights: Array) -> Array:
        """Return the factor's columns of the weighted sum of the parts: itself, then each slow copy of it."""
        return np.einsum("rpt,p->rt", self.factor[:, :-1].reshape(-1, *self.shape), weights)

    @property
    def constant(self) -> Array:
        """The factor's column of the offset."""
        return self.factor[:, -1]


def creeping(model: Model, gains: Sequence[float], taus_s: Sequence[float]) -> Model:
    """Return the model with slow copies of its displacement."""
    return model.with_block("creep", gains=tuple(gains), time_constants_s=tuple(taus_s)) if gains else model
