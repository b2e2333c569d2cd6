"""What is left of one record, ready for equations: every term integrated from row to row, the equation re-simulated.

Nothing is differentiated or resampled: an equation for dr/dt is held against r over the rows that there are, however
uneven, and runs through lost readings because voltage and simulated tip are known there.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_inference.equation.lead_terms import Term
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.output_error import Fitted
from bender_inference.records.observations import Array, Mask, Observations
from bender_inference.records.roles import BLOCKS

# of every three blocks of a record the second is held out, and equations are compared on the third
CHOOSING = 2
EVERY_BLOCKS = 3
# an exponent beyond which a solution has run away
RUNAWAY = 30.0
_SIMPSON = np.array([1.0, 4.0, 1.0])[:, None] / 6.0


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One record, arrays of shape (n,) over the rows that are used.

    Attributes:
        rows: of the record.
        left_um: measured minus calibrated simulation, NaN where lost or outlying.
        reading_um: that of the model, which the gain multiplies.
        tip_um: that of the model.
        acting_V: the voltage that acted while each row was read.
        time_s: of the readings.
        usable: readings that count.
        held_out: rows that are excluded from fits.
        choosing: other rows, on which equations are compared.
        terms: of dr/dt.
        jumps: (n - 1, number of terms) integrals from row to row, without the factor r, of what happens at the
            change of a held voltage.
        flows: the same of what happens until the next one.
    """

    rows: NDArray[np.intp]
    left_um: Array
    reading_um: Array
    tip_um: Array
    acting_V: Array
    time_s: Array
    usable: Mask
    held_out: Mask
    choosing: Mask
    terms: tuple[Term, ...]
    jumps: Array
    flows: Array

    @property
    def training(self) -> Mask:
        """Rows that a fit may use."""
        return self.usable & ~self.held_out

    @property
    def judging(self) -> Mask:
        """Rows that the equation is judged on."""
        return self.usable & self.held_out

    def at_rows(self, term: Term) -> Array:
        """Return a term of an equation for r itself."""
        found = term.of_tip_and_voltage(self.acting_V, self.tip_um)
        if not term.rate:
            return found
        rate = np.gradient(self.tip_um, self.time_s)
        return found * (np.abs(rate) if term.rate == "|y|" else rate)

    def integrals(self, left_um: Array) -> Array:
        """Return the integrals (n - 1, number of terms) of all terms along readings without a gap."""
        middle = 0.5 * (left_um[1:] + left_um[:-1])
        # under a held voltage r has jumped when an interval begins: its end tells what flows from there
        flowing = left_um[1:] if np.any(self.jumps) else middle
        found = np.empty_like(self.flows)
        for k, term in enumerate(self.terms):
            at_jump, after = (np.abs(x) if term.magnitude == "r" else x for x in (middle, flowing))
            factors = (at_jump, after) if term.r else (1.0, 1.0)
            found[:, k] = factors[0] * self.jumps[:, k] + factors[1] * self.flows[:, k]
        return found

    def simulated_um(self, chosen: Sequence[int], coefficients: Sequence[float]) -> Array:
        """Return the solution of an equation for dr/dt from 0, freely running over all rows; inf where it runs away."""
        signs = (1.0, -1.0) if any(self.terms[k].magnitude == "r" for k in chosen) else (1.0,)
        branches = [self._from_row_to_row(sign, chosen, coefficients) for sign in signs]
        value, found = 0.0, [0.0]
        if len(branches) == 1:
            for factor, summand in zip(*branches[0], strict=True):
                value = factor * value + summand
                found.append(value)
            return np.array(found)
        for a, b, c, d in zip(*branches[0], *branches[1], strict=True):
            value = a * value + b if value >= 0.0 else c * value + d
            found.append(value)
        return np.array(found)

    def _from_row_to_row(
        self, sign: float, chosen: Sequence[int], coefficients: Sequence[float]
    ) -> tuple[list[float], list[float]]:
        """Return factors and summands of all steps from row to row, for r of one sign."""
        factor, summand = self._step(self.flows, sign, chosen, coefficients)
        if np.any(self.jumps):
            up, added = self._step(self.jumps, sign, chosen, coefficients)
            factor, summand = factor * up, factor * added + summand
        return factor.tolist(), summand.tolist()

    def _step(
        self, integrals: Array, sign: float, chosen: Sequence[int], coefficients: Sequence[float]
    ) -> tuple[Array, Array]:
        """Return factors and summands of steps, exact where voltage and tip stand still."""
        exponent, alone = (np.zeros(len(integrals)) for _ in range(2))
        for k, value in zip(chosen, coefficients, strict=True):
            term = self.terms[k]
            if term.r:
                exponent += (sign * value if term.magnitude == "r" else value) * integrals[:, k]
            else:
                alone += value * integrals[:, k]
        if not np.any(exponent):
            return np.ones_like(exponent), alone
        exponent = np.clip(exponent, -RUNAWAY, RUNAWAY)
        growth = np.expm1(exponent)
        small = np.abs(exponent) < 1e-9
        return 1.0 + growth, alone * np.where(small, 1.0, growth / np.where(small, 1.0, exponent))


def tracks(bench: FitProblem, fitted: Fitted, terms: tuple[Term, ...], most_rows: int) -> list[Track]:
    """Return what a hypothesis leaves of every record, at most so many rows of all of them together.

    Raises:
        ModelError: the hypothesis cannot be simulated.
        ArithmeticError: it ran away.
    """
    every = max(1, -(-sum(x.measured_um.size for x in bench.observations) // most_rows))
    return [_track(bench, fitted, terms, k, every) for k in range(len(bench.observations))]


def _track(bench: FitProblem, fitted: Fitted, terms: tuple[Term, ...], record: int, every: int) -> Track:
    x = bench.observations[record]
    response = bench.fine[record].run(fitted.hypothesis.model(bench.base, record))
    simulated = fitted.calibration.gain * response.reading_um + fitted.calibration.offsets_um[record]
    rows = np.arange(0, x.measured_um.size, every)
    volts = x.acting_V
    jumps, flows = _integrals(x, terms, volts, response.tip_um, rows)
    left = np.where(x.usable, x.measured_um - simulated, np.nan)
    return Track(
        rows=rows,
        left_um=left[rows],
        reading_um=response.reading_um[rows],
        tip_um=response.tip_um[rows],
        acting_V=volts[rows],
        time_s=x.time_s[rows],
        usable=x.usable[rows],
        held_out=x.held_out[rows],
        choosing=rows * BLOCKS // x.measured_um.size % EVERY_BLOCKS == CHOOSING,
        terms=terms,
        jumps=jumps,
        flows=flows,
    )


def _integrals(
    x: Observations, terms: tuple[Term, ...], volts: Array, tip_um: Array, rows: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Return the integrals of all terms between used rows, without r: at the changes of a held voltage, and after."""
    moving = _nodes(volts)
    tip = _nodes(tip_um)
    standing = moving if x.drive.linear else np.broadcast_to(volts[1:], moving.shape)
    before = tip if x.drive.linear else np.broadcast_to(tip_um[:-1], tip.shape)
    jumps, flows = (np.zeros((rows.size - 1, len(terms))) for _ in range(2))
    for k, term in enumerate(terms):
        by_voltage = term.rate.strip("|") == "v"
        where = (moving, before) if by_voltage else (standing, tip)
        mean = np.sum(_SIMPSON * term.of_tip_and_voltage(*where), axis=0)
        into = jumps if by_voltage and not x.drive.linear else flows
        steps = mean * _length(term, x.time_s, volts, tip_um)
        into[:, k] = np.add.reduceat(steps[: rows[-1]], rows[:-1])
    return jumps, flows


def _nodes(values: Array) -> Array:
    """Return a signal at the beginning, middle and end of each step from row to row, (3, n - 1)."""
    return np.stack([values[:-1], 0.5 * (values[:-1] + values[1:]), values[1:]])


def _length(term: Term, time_s: Array, volts: Array, tip_um: Array) -> Array:
    if not term.rate:
        return np.diff(time_s)
    changes = np.diff(volts if term.rate.strip("|") == "v" else tip_um)
    return np.abs(changes) if term.rate[0] == "|" else changes
