"""The tests side by side over rows that come without an end, in memory that does not grow."""

from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_watch.sequential.kernel import (
    CUSUMS,
    LEVEL_REFERENCE,
    LEVELS,
    LOUD_REFERENCE,
    PLACES,
    QUIET_REFERENCE,
    WINDOWS_PER_ROW,
    detector_run,
)
from bender_watch.sequential.run_length import clipped_normal, clipped_square, cusum_threshold, glr_threshold

Array = NDArray[np.float64]

CLIP, QUIET_CLIP = 3.2, 2.5
"""Of an innovation in its deviation: three outlying readings in a row stay below the threshold of a million rows."""
COLOURS = ("colour_1", "colour_2")
"""Signatures that every residual has: its own last rows, which foretell nothing while the noise is as it was."""
JUDGED, NOT_JUDGED, GAP = 0, 1, 16
"""What a row is: judged, seen only, and either of them behind a gap (added to it)."""


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """The noise of a training record: predictors of every order up to p, and what they leave.

    Attributes:
        coefficients: (p + 1, p) of each order, those of order m in row m.
        spreads_um: (p + 1,) deviation of what each order leaves.
    """

    coefficients: Array
    spreads_um: Array


@dataclass(frozen=True, slots=True, eq=False)
class Tests:
    """What is tested, and where it alarms.

    Attributes:
        names: (j,) of the signatures, `COLOURS` last.
        allowances: (j,) how far each amplitude goes astray while nothing has changed.
        inflations: (j,) of the variance of a score, for what the training record leaves open of the noise.
        one_sided: (j,) only positive amplitudes are changes.
        cusum_limits: (4,) of `CUSUMS`.
        glr_limits: (j,) of the square root of twice the log-likelihood ratio.
        rows_between_false_alarms: of all tests together.
    """

    __test__ = False

    names: tuple[str, ...]
    allowances: Array
    inflations: Array
    one_sided: NDArray[np.bool_]
    cusum_limits: Array
    glr_limits: Array
    rows_between_false_alarms: float

    @property
    def count(self) -> int:
        """How many tests there are."""
        return len(CUSUMS) + len(self.names)

    def scaled(self, factor: float) -> "Tests":
        """Return the same tests with all thresholds so many times as large."""
        return replace(self, cusum_limits=factor * self.cusum_limits, glr_limits=factor * self.glr_limits)


def make_tests(
    names: tuple[str, ...],
    allowances: Array,
    inflations: Array,
    one_sided: NDArray[np.bool_],
    rows: float,
    level_inflation: float = 1.0,
    doubt: float = 0.0,
) -> Tests:
    """Return the tests with thresholds for a mean time between false alarms of all of them together.

    Each test gets an equal part of the false alarms: the rate of the union is at most the sum of the rates.

    Args:
        names: (j - 2,) of the signatures; the colours are added.
        allowances: (j - 2,) of their amplitudes.
        inflations: (j - 2,) of their scores' variance.
        one_sided: (j - 2,).
        rows: between false alarms.
        level_inflation: of the variance of a sum of rows.
        doubt: of the variance of a row, as a part of it.
    """
    each = rows * (len(CUSUMS) + len(names) + len(COLOURS))
    b, colours = glr_threshold(each, WINDOWS_PER_ROW), len(COLOURS)
    return Tests(
        (*names, *COLOURS),
        np.append(allowances, np.zeros(colours)),
        np.append(inflations, np.ones(colours)),
        np.append(one_sided, np.zeros(colours, bool)),
        np.array(_cusum_limits(each, doubt)) * [level_inflation, level_inflation, 1.0, 1.0],
        np.full(len(names) + colours, b),
        rows,
    )


@cache
def _cusum_limits(rows: float, doubt: float) -> tuple[float, ...]:
    """Return the thresholds of `CUSUMS`, each of which runs for so many rows, at the variance that is worst for it."""
    level = cusum_threshold(rows, LEVEL_REFERENCE, clipped_normal(CLIP))
    louder = cusum_threshold(rows, LOUD_REFERENCE, clipped_square(QUIET_CLIP, variance=1.0 + doubt))
    quieter = cusum_threshold(rows, -QUIET_REFERENCE, clipped_square(QUIET_CLIP, -1.0, 1.0 - doubt))
    return level, level, louder, quieter


@dataclass(frozen=True, slots=True)
class Exceedance:
    """A test beyond its threshold.

    Attributes:
        row: of the stretch that was judged.
        test: of `CUSUMS`, or the name of a signature.
        rows: judged ones from where the change is taken to have begun.
        statistic: of the test.
        threshold: that it exceeds, in the statistic's unit.
    """

    row: int
    test: str
    rows: int
    statistic: float
    threshold: float


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """What was seen of a stretch of rows.

    Attributes:
        innovations: (n,) whitened residual, NaN where no reading came.
        drifts: (n,) what the drift that is followed has taken from the innovations.
        whitened: (n, j) whitened signatures.
        tops: (n,) largest statistic over its threshold, 0 where the row is not judged.
        rows: of the stretch that were judged, up to an exceedance.
        exceedance: the first one, None where there is none.
    """

    innovations: Array
    drifts: Array
    whitened: Array
    tops: Array
    rows: int
    exceedance: Exceedance | None


@dataclass(slots=True)
class Detector:
    """The state of the tests.

    Attributes:
        noise: of the training record.
        tests: what is tested.
        unknowns: columns that are not known.
        followed: of them, the last ones, which are a drift: positions, then their slopes.
    """

    noise: Noise
    tests: Tests
    unknowns: int = 0
    followed: int = 0
    _arrays: dict[str, NDArray[Any]] = field(init=False)

    def __post_init__(self) -> None:
        order, size = self.noise.coefficients.shape[1], len(self.tests.names)
        self._arrays = {
            "past": np.zeros(order),
            "past_signatures": np.zeros((size - len(COLOURS), order)),
            "past_columns": np.zeros((self.unknowns, order)),
            "amplitudes": np.zeros(self.unknowns),
            "covariance": np.zeros((self.unknowns, self.unknowns)),
            "age": np.ones(1),
            "counts": np.zeros(3, np.int64),
            "sums": np.zeros(size),
            "informations": np.zeros(size),
            "ring_sums": np.zeros((LEVELS, PLACES, size)),
            "ring_informations": np.zeros((LEVELS, PLACES, size)),
            "ring_filled": np.zeros(LEVELS, np.int64),
            "cusums": np.zeros(len(CUSUMS)),
            "cusum_since": np.zeros(len(CUSUMS), np.int64),
            "alarm": np.zeros(16),
        }

    def reset(self) -> None:
        """Forget what speaks for a change; the past that foretells the next row stays."""
        for name in ("sums", "informations", "ring_filled", "cusums", "cusum_since"):
            self._arrays[name][:] = 0
        self._arrays["counts"][1] = 0

    @property
    def amplitudes(self) -> Array:
        """What is known of the columns (unknowns,)."""
        return self._arrays["amplitudes"]

    @property
    def covariance(self) -> Array:
        """How well it is known (unknowns, unknowns)."""
        return self._arrays["covariance"]

    @property
    def drift(self) -> tuple[Array, Array]:
        """What is known of the drift: its positions, their slopes behind them, and the covariance of all."""
        followed = slice(self.unknowns - self.followed, None)
        return self.amplitudes[followed].copy(), self.covariance[followed, followed].copy()

    def drift_um(self, columns: Array, ahead: Array) -> Array:
        """Return what the drift adds to readings (n,), so many of its lengths from now.

        Args:
            columns: (n, followed) what an amplitude of 1 of each position, and of each slope, adds.
            ahead: (n,) lengths.
        """
        at, slopes = np.split(self.drift[0], 2)
        return np.sum(columns[:, : at.size] * (at + ahead[:, None] * slopes), axis=1)

    def take_known(self, amplitudes: Array, covariance: Array) -> None:
        """Begin with what is known of the columns; what was read before foretells nothing."""
        self._arrays["amplitudes"][:], self._arrays["covariance"][:] = amplitudes, covariance
        self.forget()

    def unlearn(self, columns: slice, deviation: float) -> None:
        """Know no more of some columns than the deviation of their amplitudes; the next row is behind a gap."""
        amplitudes, covariance = self.amplitudes, self.covariance
        amplitudes[columns] = covariance[columns] = covariance[:, columns] = 0.0
        np.fill_diagonal(covariance[columns, columns], deviation**2)
        self.forget()

    def forget(self) -> None:
        """Take the next row for one behind a gap."""
        self._arrays["counts"][0] = self._arrays["counts"][2] = 0

    def judge(
        self, residual_um: Array, signatures_um: Array, kinds: NDArray[np.int64], spread: Array, begin: int = 0,
        columns_um: Array | None = None, steps: Array | None = None,
    ) -> Judged:  # fmt: skip
        """Take rows until a test exceeds its threshold, or all.

        Args:
            residual_um: (n,) measured minus expected, NaN for a lost reading.
            signatures_um: (n, j - 2) what each effect of unit size adds to the reading.
            kinds: (n,) `JUDGED` or `NOT_JUDGED`, plus `GAP` behind a gap.
            spread: (n,) factor on the deviation of the noise, 1 where it is as ever.
            begin: first row that is taken.
            columns_um: (n, unknowns + 1) what an amplitude of 1 of each adds to the residual, and last by how many
                deviations of the noise a row may be off beside them; None for nothing.
            steps: (n,) time before each row in lengths of the drift; None where none is followed.
        """
        rows, size = residual_um.size, len(self.tests.names)
        innovations, whitened = np.full(rows, np.nan), np.zeros((rows, size))
        drifts, tops = np.zeros(rows), np.zeros(rows)
        x, tests = self._arrays, self.tests
        before = int(x["counts"][1])
        columns = np.zeros((rows, self.unknowns + 1)) if columns_um is None else columns_um
        passed = np.zeros(rows) if steps is None else steps
        row = detector_run()(
            begin, residual_um, signatures_um, columns, self.followed, passed, x["age"], kinds, spread,
            self.noise.coefficients, self.noise.spreads_um, x["past"], x["past_signatures"], x["past_columns"],
            x["amplitudes"], x["covariance"], x["counts"], CLIP, QUIET_CLIP, x["sums"], x["informations"],
            x["ring_sums"], x["ring_informations"], x["ring_filled"], x["cusums"], x["cusum_since"],
            tests.allowances, tests.inflations, tests.one_sided, tests.cusum_limits, tests.glr_limits, innovations,
            drifts, whitened, tops, x["alarm"],
        )  # fmt: skip
        judged = int(x["counts"][1]) - before
        return Judged(innovations, drifts, whitened, tops, judged, None if row < 0 else self._exceedance(row))

    def _exceedance(self, row: int) -> Exceedance:
        _, which, rows, statistic = self._arrays["alarm"][:4].tolist()
        place = int(which)
        if place < len(CUSUMS):
            return Exceedance(row, CUSUMS[place], int(rows), statistic, float(self.tests.cusum_limits[place]))
        place -= len(CUSUMS)
        return Exceedance(row, self.tests.names[place], int(rows), statistic, float(self.tests.glr_limits[place]) ** 2)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return all that is remembered, by name."""
        return {name: values.copy() for name, values in self._arrays.items()}

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Go on from a state of the same tests.

        Raises:
            ValueError: it is of other tests.
        """
        for name, values in self._arrays.items():
            if state[name].shape != values.shape:
                raise ValueError("found the state of other tests")
            values[...] = state[name]
