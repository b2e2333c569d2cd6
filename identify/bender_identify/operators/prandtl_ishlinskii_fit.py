"""The Prandtl-Ishlinskii operator by bounded least squares on simulated plays.

The operator is linear in its weights, so each play is simulated once through the chain and its weight solved for with
a bound of zero (Kuhnen, European Journal of Control 9, 2003, demands weights >= 0 for a plant that loses energy). A
polynomial in the voltage bends the operator, slow copies make it creep; each is kept only where the information
criterion asks for it. A polynomial is carried by the block `sparse_equation` (u', u u', u^2 u' are the rates of u,
u^2 / 2, u^3 / 3) with the plays beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_identify.fitting.candidate import Candidate, Coefficient, with_offset
from bender_identify.fitting.correlation import correlation_rows
from bender_identify.fitting.output_error import OutputFit, information
from bender_identify.fitting.resimulation import search_bank, with_transducer
from bender_identify.operators.play_columns import DEGREES, PlayColumns, creeping
from bender_identify.records.experiment import Experiment
from bender_plant.model import Model

Array = NDArray[np.float64]

PLAYS = 10
"""Their half-widths are evenly spaced up to half the span of the voltage."""
ALTERNATIONS, MOST_EVALUATIONS = 5, 300
CREEP_PER_DURATION = (0.01, 0.05, 0.25, 1.0)
QUICKEST_CREEP_S, SLOWEST_CREEP_S = 1e-3, 1e6
"""What the block `creep` takes."""
ROUNDING = 1e-9
SMALLEST_WEIGHT = 1e-6
"""A weight below this part of the largest is at its bound and dropped."""


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """The linear parts of the operator.

    Attributes:
        thresholds_V: half-widths of the plays.
        degrees: powers of the voltage beside the first.
        taus_s: time constants of the slow copies, empty for none.
    """

    thresholds_V: tuple[float, ...]
    degrees: tuple[int, ...] = ()
    taus_s: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """Solved weights: gain on u, plays, powers, creep gains, and the offset."""

    gain: float
    plays: Array
    powers: Array
    creep: Array
    offset_um: float


def fit_prandtl_ishlinskii(experiments: Sequence[Experiment], base: Model) -> Candidate:
    """Fit the operator to the fitted rows, in the variant that the information criterion prefers.

    Args:
        experiments: records made ready.
        base: gives everything but the material.
    """
    half_V = 0.5 * max(float(np.ptp(x.acting_V)) for x in experiments)
    thresholds = tuple(float(half_V * k / (PLAYS + 1)) for k in range(1, PLAYS + 1))
    duration = max(float(x.time_s[-1] - x.time_s[0]) for x in experiments)
    row_s = max(float(np.median(np.diff(x.time_s))) for x in experiments)
    taus = creep_times_s(duration, row_s) if all(x.timed for x in experiments) else ()
    shapes = [Shape(thresholds, degrees, creep) for degrees in ((), DEGREES) for creep in dict.fromkeys(((), taus))]
    columns = PlayColumns(search_bank(experiments, base), base, thresholds, taus)
    fits = [(shape, *_solved(columns, shape)) for shape in shapes]
    rows = min(correlation_rows(residual) for _, _, residual in fits)
    size = float(np.std(columns.measured))

    def criterion(fit: tuple[Shape, Weights, Array]) -> float:
        _, weights, residual = fit
        rss = float(residual @ residual)
        return information(rss, len(residual), _count(weights), rows, ROUNDING * size)

    shape, _, _ = min(fits, key=criterion)
    return _candidate(columns, shape, base)


def creep_times_s(duration_s: float, row_s: float) -> tuple[float, ...]:
    """Return the time constants to try for a record of this duration with rows this far apart."""
    times = (float(f"{duration_s * part:.3g}") for part in CREEP_PER_DURATION)
    return tuple(x for x in times if max(4.0 * row_s, QUICKEST_CREEP_S) < x <= SLOWEST_CREEP_S)


def _solved(columns: PlayColumns, shape: Shape) -> tuple[Weights, Array]:
    """Solve for the weights; with creep for the gains in turn, each linear while the other stands, then together."""
    count = 1 + len(shape.thresholds_V) + len(shape.degrees)
    weights, gains, offset = np.zeros(len(columns.names)), np.zeros(len(columns.taus_s)), 0.0
    sign = (0.0, np.inf) if columns.rises else (-np.inf, 0.0)
    bounds = [sign if name.startswith("F") else (-np.inf, np.inf) for name in columns.names[:count]]
    for _ in range(ALTERNATIONS if shape.taus_s else 1):
        weights[:count], offset = _bounded(columns.mixed(gains)[:, :count], columns.constant, columns.reading, bounds)
        if shape.taus_s:
            moved = columns.slowed(weights)
            rest = columns.reading - moved[:, 0]
            gains, offset = _bounded(moved[:, 1:], columns.constant, rest, [(0.0, np.inf)] * len(gains))
    if shape.taus_s:
        weights[:count], gains, offset = _together(columns, weights[:count], gains, offset, bounds)
    plays = len(shape.thresholds_V)
    creep = gains if shape.taus_s else gains[:0]
    found = Weights(float(weights[0]), weights[1 : 1 + plays], weights[1 + plays : count], creep, offset)
    amounts = np.append(np.outer(weights, np.concatenate([[1.0], gains])).ravel(), offset)
    return found, columns.measured - columns.still - columns.whole @ amounts


def _together(
    columns: PlayColumns, weights: Array, gains: Array, offset: float, bounds: list[tuple[float, float]]
) -> tuple[Array, Array, float]:
    """Move weights and gains at once, from where taking turns has come close."""
    from scipy.optimize import least_squares

    count, end = len(weights), len(weights) + len(gains)
    padded = np.zeros(len(columns.names))

    def split(x: Array) -> Array:
        padded[:count] = x[:count]
        return padded

    def residual(x: Array) -> Array:
        moved = columns.slowed(split(x)) @ np.concatenate([[1.0], x[count:end]])
        return moved + x[end] * columns.constant - columns.reading

    def slopes(x: Array) -> Array:
        own = columns.mixed(x[count:end])[:, :count]
        return np.column_stack([own, columns.slowed(split(x))[:, 1:], columns.constant])

    low, high = zip(*bounds, *[(0.0, np.inf)] * len(gains), (-np.inf, np.inf), strict=True)
    start = np.clip(np.concatenate([weights, gains, [offset]]), low, high)
    found = least_squares(
        residual, start, jac=slopes,  # pyright: ignore[reportArgumentType]
        bounds=(low, high), x_scale="jac", xtol=1e-12, ftol=1e-12, max_nfev=MOST_EVALUATIONS,
    ).x  # fmt: skip
    found[:end][np.abs(found[:end]) < SMALLEST_WEIGHT * np.abs(found[:count]).max()] = 0.0
    return found[:count], found[count:end], float(found[end])


def _bounded(columns: Array, constant: Array, y: Array, bounds: list[tuple[float, float]]) -> tuple[Array, float]:
    from scipy.optimize import lsq_linear

    full = np.column_stack([columns, constant])
    size = np.linalg.norm(full, axis=0)
    size[size == 0.0] = 1.0
    low, high = zip(*bounds, (-np.inf, np.inf), strict=True)
    solution = lsq_linear(full / size, y, (low, high), method="bvls").x
    amounts = solution / size
    amounts[:-1][np.abs(solution[:-1]) < SMALLEST_WEIGHT * np.abs(solution[:-1]).max(initial=1e-300)] = 0.0
    return amounts[:-1], float(amounts[-1])


def _count(weights: Weights) -> int:
    found = sum(int(np.count_nonzero(x)) for x in (weights.plays, weights.powers, weights.creep))
    return found + 2


def _model(base: Model, shape: Shape, weights: Weights) -> Model:
    kept = [k for k in range(len(shape.thresholds_V)) if weights.plays[k] != 0.0]
    thresholds = tuple(shape.thresholds_V[k] for k in kept)
    plays = tuple(float(weights.plays[k]) for k in kept)
    if not shape.degrees:
        model = with_transducer(
            base, "prandtl_ishlinskii",
            linear_gain_um_per_V=weights.gain, thresholds_V=thresholds, weights_um_per_V=plays,
        )  # fmt: skip
    else:
        terms = ("u'", *(f"u^{n - 1} u'" for n in shape.degrees))
        # what the plays lag behind the voltage stands beside, so the plays' sum joins the linear term
        powers = (
            weights.gain + sum(plays),
            *(n * float(x) for n, x in zip(shape.degrees, weights.powers, strict=True)),
        )
        model = with_transducer(base, "sparse_equation", terms=terms, coefficients=powers).with_block(
            "rate_independent_hysteresis", form="plays", thresholds_V=thresholds, weights_um_per_V=plays
        )
    crept = [(g, tau) for g, tau in zip(weights.creep.tolist(), shape.taus_s, strict=True) if g > 0.0]
    return creeping(model, [g for g, _ in crept], [tau for _, tau in crept])


def _candidate(columns: PlayColumns, shape: Shape, base: Model) -> Candidate:
    weights, residual = _solved(columns, shape)
    coefficients = [Coefficient("u", weights.gain, "um/V")]
    coefficients += [
        Coefficient(f"F_{r:.3g}V(u)", float(x), "um/V")
        for r, x in zip(shape.thresholds_V, weights.plays, strict=True) if x != 0.0
    ]  # fmt: skip
    coefficients += [
        Coefficient(f"u^{n}", float(x), f"um/V^{n}") for n, x in zip(shape.degrees, weights.powers, strict=True)
    ]
    coefficients += [
        Coefficient(f"creep, {tau:g} s", float(g), "1")
        for g, tau in zip(weights.creep, shape.taus_s, strict=True) if g > 0.0
    ]  # fmt: skip
    fit = OutputFit(
        np.array([c.value for c in coefficients]), weights.offset_um,
        np.full((len(coefficients) + 1,) * 2, np.nan), np.zeros((len(residual), 0)),
        residual, columns.measured - residual, correlation_rows(residual),
    )  # fmt: skip
    return Candidate(
        id="prandtl_ishlinskii",
        title=_title(shape, weights),
        equation=_equation(shape, weights),
        model=with_offset(_model(base, shape, weights), weights.offset_um),
        coefficients=tuple(coefficients),
        parameters=_count(weights),
        fit=fit,
        refit=lambda others: _candidate(
            PlayColumns(search_bank(others, base), base, shape.thresholds_V, shape.taus_s), shape, base
        ),
    )


def _title(shape: Shape, weights: Weights) -> str:
    plays = np.count_nonzero(weights.plays)
    title = f"Prandtl-Ishlinskii, {plays} play{'' if plays == 1 else 's'}"
    title += ", cubic polynomial" if shape.degrees else ""
    return title + (", creep" if np.any(weights.creep > 0.0) else "")


def _equation(shape: Shape, weights: Weights) -> str:
    parts = [f"{weights.gain:.4g} u"]
    parts += [f"{x:.4g} F_{r:.3g}V(u)" for r, x in zip(shape.thresholds_V, weights.plays, strict=True) if x != 0.0]
    parts += [f"{x:.4g} u^{n}" for n, x in zip(shape.degrees, weights.powers, strict=True)]
    slow = [f"{g:.4g} LP_{tau:g}s" for g, tau in zip(weights.creep, shape.taus_s, strict=True) if g > 0.0]
    line = "w = " + " + ".join(parts).replace("+ -", "- ")
    return line if not slow else f"{line}; w -> w + ({' + '.join(slow)})(w)"
