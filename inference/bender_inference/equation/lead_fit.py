"""An equation for the residual, fitted and judged by running it freely over the records."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from bender_inference.equation.lead_terms import Term
from bender_inference.equation.lead_track import Track
from bender_inference.records.observations import Array, Mask

MOST_EVALUATIONS = 8
# a solution this many times as large as the residual has run away
FAR = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class Equation:
    """A sparse equation with its numbers.

    Attributes:
        support: which of the terms on the ground it has.
        terms: of the right-hand side.
        coefficients: in um, V and s.
        per_second: for dr/dt; otherwise for r itself.
        gives_um: what it gives for r on the rows of all records, with what gain and offsets add.
        beside_um: what gain and offsets add, readjusted beside it.
    """

    support: tuple[int, ...]
    terms: tuple[Term, ...]
    coefficients: tuple[float, ...]
    per_second: bool
    gives_um: Array
    beside_um: Array


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """What equations are fitted to: all records, one after the other, arrays of shape (n,).

    Attributes:
        tracks: the records.
        at_once: terms of an equation for r itself.
        left_um: NaN where lost.
        free: (n, k) what gain and offsets add.
        noise_square: the floor of the mean square, um^2.
    """

    tracks: tuple[Track, ...]
    at_once: tuple[Term, ...]
    left_um: Array
    free: Array
    noise_square: float

    @classmethod
    def of(cls, tracks: Sequence[Track], at_once: tuple[Term, ...], noise_square: float) -> "Ground":
        """Lay records one after the other."""
        record = np.repeat(np.arange(len(tracks)), [x.rows.size for x in tracks])
        reading = np.concatenate([x.reading_um - x.reading_um.mean() for x in tracks])
        free = np.column_stack([reading, *(record == k for k in range(len(tracks)))])
        return cls(tuple(tracks), at_once, np.concatenate([x.left_um for x in tracks]), free, noise_square)

    def mask(self, of: Callable[[Track], Mask]) -> Mask:
        """Return rows of all records."""
        return np.concatenate([of(x) for x in self.tracks])

    def split(self, values: Array) -> list[Array]:
        """Return values of all records by record."""
        return np.split(values, np.cumsum([x.rows.size for x in self.tracks])[:-1])

    def share(self, equation: Equation, rows: Mask) -> float:
        """Return the part of the variance above the noise that an equation removes on some rows; 0 where none is."""
        above = float(np.mean(self.left_um[rows] ** 2)) - self.noise_square
        rest = float(np.mean((self.left_um - equation.gives_um)[rows] ** 2)) - self.noise_square
        return 1.0 - max(rest, 0.0) / above if above > 0.0 else 0.0

    def spoils(self, equation: Equation, pieces: Sequence[Mask]) -> float:
        """Return what an equation adds to the squares of some pieces of records over what it removes from others."""
        squares = self.left_um**2 - (self.left_um - equation.gives_um) ** 2
        removed = np.array([float(np.sum(squares[x])) for x in pieces])
        gained = float(np.sum(np.maximum(removed, 0.0)))
        return float(np.sum(np.maximum(-removed, 0.0))) / gained if gained > 0.0 else np.inf


def fitted_at_once(ground: Ground, support: Sequence[int], rows: Mask) -> Equation:
    """Return an equation for r itself, by least squares on some rows."""
    terms = tuple(ground.at_once[k] for k in support)
    columns = np.concatenate([np.stack([x.at_rows(t) for t in terms], axis=1) for x in ground.tracks])
    columns = np.column_stack([columns, ground.free])
    sizes = np.maximum(np.sqrt(np.mean(columns[rows] ** 2, axis=0)), 1e-300)
    solution = np.linalg.lstsq(columns[rows] / sizes, ground.left_um[rows], rcond=None)[0] / sizes
    return Equation(
        tuple(support),
        terms,
        tuple(solution[: len(terms)].tolist()),
        False,
        columns @ solution,
        ground.free @ solution[len(terms) :],
    )


class _Run:
    """An equation for dr/dt run freely with any coefficients; gain and offsets are solved for on some rows."""

    def __init__(self, ground: Ground, support: Sequence[int], rows: Mask) -> None:
        self._ground, self._support, self._rows = ground, support, rows
        self._basis, self._corner = np.linalg.qr(ground.free[rows])
        self._target = ground.left_um[rows]
        self._far = FAR * float(np.max(np.abs(self._target)))

    def _solved(self, coefficients: Array) -> Array:
        with np.errstate(over="ignore", invalid="ignore"):
            found = [x.simulated_um(self._support, coefficients.tolist()) for x in self._ground.tracks]
        return np.clip(np.nan_to_num(np.concatenate(found), nan=self._far), -self._far, self._far)

    def apart(self, coefficients: Array) -> Array:
        """Return r minus what the equation gives, on the rows of the fit."""
        found = self._target - self._solved(coefficients)[self._rows]
        return found - self._basis @ (self._basis.T @ found)

    def gives(self, coefficients: Array) -> tuple[Array, Array] | None:
        """Return what the equation gives for r on all rows, and what gain and offsets add; None where it runs away."""
        found = self._solved(coefficients)
        if np.max(np.abs(found)) >= self._far:
            return None
        beside = self._basis.T @ (self._target - found[self._rows])
        return found, self._ground.free @ np.linalg.solve(self._corner, beside)


def misfit(ground: Ground, support: Sequence[int], coefficients: Array, rows: Mask) -> float:
    """Return the mean square between r and the free run of an equation for dr/dt on some rows, in um^2."""
    return float(np.mean(_Run(ground, support, rows).apart(coefficients) ** 2))


def fitted_in_time(ground: Ground, support: Sequence[int], starts: Sequence[Array], rows: Mask) -> Equation | None:
    """Return an equation for dr/dt, by least squares between its free run and r on some rows; None if it runs away.

    Gain and offsets are solved for inside, as everywhere in a diagnosis.

    Args:
        ground: the records.
        support: which of their terms.
        starts: coefficients to start from; the best of them is taken.
        rows: of the fit.
    """
    found = _Run(ground, support, rows)
    start = min(starts, key=lambda x: float(np.sum(found.apart(x) ** 2)))
    scales = np.where(start == 0.0, 1.0, np.abs(start))
    options: dict[str, Any] = {"x_scale": "jac", "max_nfev": MOST_EVALUATIONS}
    coefficients = least_squares(lambda x: found.apart(x * scales), start / scales, **options).x * scales
    gives = found.gives(coefficients)
    if gives is None:
        return None
    terms = tuple(ground.tracks[0].terms[k] for k in support)
    return Equation(tuple(support), terms, tuple(coefficients.tolist()), True, gives[0] + gives[1], gives[1])
