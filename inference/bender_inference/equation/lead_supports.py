"""Which terms may make up the equation: PySINDy's sparse regression, at once or in its weak form."""

from collections.abc import Iterator, Sequence

import numpy as np

from bender_identify.regression.rates import Regression
from bender_identify.regression.sparse_fit import Support, greedy_supports, supports
from bender_inference.equation.lead_terms import Term
from bender_inference.equation.lead_track import Track
from bender_inference.records.observations import Array

MOST_TERMS = 5
HALF_WINDOWS = (2, 8, 32, 128)
# windows that are evaluated at one width, and the fewest that are worth it
MOST_WINDOWS, FEWEST_WINDOWS = 4000, 30
LONGEST_GAP_ROWS = 3
# columns whose directions have a larger cosine than this are one
SAME = 0.999
BUMP_POWER = 2


def at_once_supports(tracks: Sequence[Track], terms: Sequence[Term]) -> set[Support]:
    """Return sets of terms of an equation for r itself; gain and offsets are left free."""
    columns = np.concatenate([np.stack([x.at_rows(t) for t in terms], axis=1)[x.training] for x in tracks])
    left = np.concatenate([x.left_um[x.training] for x in tracks])
    free = _blocks([np.ones((int(x.training.sum()), 1)) for x in tracks])
    free = np.column_stack([free, np.concatenate([x.reading_um[x.training] for x in tracks])])
    return _supports(columns, left, free)


def weak_supports(tracks: Sequence[Track], beside_um: Sequence[Array]) -> dict[Support, list[Array]]:
    """Return sets of terms of an equation for dr/dt, each with the coefficients that windows of some widths give.

    Both sides are integrated against a bump over each window, so no reading is differentiated (Messenger and Bortz,
    Journal of Computational Physics 443, 2021). Gain and offset of r add a multiple of the reading, its rate and a
    constant to the equation: each width is tried with and without leaving these free.

    Args:
        tracks: the records.
        beside_um: what gain and offset are known to add to r.
    """
    found: dict[Support, list[Array]] = {}
    pieces = list(_pieces(tracks, beside_um))
    for half in HALF_WINDOWS:
        parts = [_windowed(*piece, half) for piece in pieces if len(piece[0]) > 2 * half]
        if sum(len(rates) for _, rates, _ in parts) < FEWEST_WINDOWS:
            continue
        columns, rates, free = (np.concatenate([part[k] for part in parts]) for k in range(3))
        for beside in (free[:, :0], free):
            for support in sorted(_supports(columns, rates, beside)):
                found.setdefault(support, []).append(_coefficients(columns[:, support], rates, beside))
    return found


def _coefficients(columns: Array, rates: Array, beside: Array) -> Array:
    every = np.column_stack([columns, beside])
    sizes = _sizes(every)
    return (np.linalg.lstsq(every / sizes, rates, rcond=None)[0] / sizes)[: columns.shape[1]]


def _pieces(tracks: Sequence[Track], beside_um: Sequence[Array]) -> Iterator[tuple[Array, Array, Array]]:
    """Yield, per run of training rows, the integrals of the terms, the changes of r and the nuisance columns."""
    for x, beside in zip(tracks, beside_um, strict=True):
        rows = np.flatnonzero(x.training)
        if rows.size < 2:
            continue
        left = np.interp(np.arange(x.left_um.size), rows, (x.left_um - beside)[rows])
        steps = np.diff(x.time_s)
        middle = 0.5 * (x.reading_um[1:] + x.reading_um[:-1])
        free = np.stack([middle * steps, np.diff(x.reading_um), steps], axis=1)
        integrals = x.integrals(left)
        apart = np.diff(rows) > LONGEST_GAP_ROWS + 1
        held_between = np.diff(np.cumsum(x.held_out)[rows]) > 0
        for run in np.split(rows, np.flatnonzero(apart | held_between) + 1):
            inside = slice(run[0], run[-1])
            yield integrals[inside], np.diff(left)[inside], free[inside]


def _windowed(integrals: Array, changes: Array, free: Array, half: int) -> tuple[Array, Array, Array]:
    at = np.arange(-half, half + 1) / (half + 1.0)
    bump = (1.0 - at * at) ** BUMP_POWER
    every = max(1, half // 2, len(changes) // MOST_WINDOWS)
    columns, rates, beside = (
        np.stack([np.convolve(column, bump, "valid")[::every] for column in values.T], axis=1)
        for values in (integrals, changes[:, None], free)
    )
    return columns, rates[:, 0], beside


def _supports(columns: Array, target: Array, free: Array) -> set[Support]:
    """Return the sets of columns that PySINDy's optimisers keep, with `free` columns fitted beside them."""
    if free.shape[1]:
        basis, _ = np.linalg.qr(free / _sizes(free))
        whole = _sizes(columns)
        columns, target = (x - basis @ (basis.T @ x) for x in (columns, target))
        columns = np.where(_sizes(columns) > (1.0 - SAME) * whole, columns, 0.0)
    kept = _distinct_columns(columns)
    size = float(np.sqrt(np.mean(target**2)))
    if not kept or size == 0.0:
        return set()
    scaled = columns[:, kept] / _sizes(columns[:, kept])
    regression = Regression(tuple(map(str, kept)), scaled, target / size, np.ones(len(kept)), "weak", 1)
    proposed = [*supports(regression), *greedy_supports(regression)]
    return {tuple(kept[k] for k in support) for support in proposed if len(support) <= MOST_TERMS}


def _sizes(columns: Array) -> Array:
    """Return the rms of columns, 1 for those of nothing."""
    sizes = np.sqrt(np.mean(columns**2, axis=0))
    return np.where(sizes > 0.0, sizes, 1.0)


def _distinct_columns(columns: Array) -> list[int]:
    """Return the columns that are something, and of any two in one direction the first."""
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    kept: list[int] = []
    for k in np.flatnonzero(np.any(columns != 0.0, axis=0)):
        if all(abs(float(scaled[:, j] @ scaled[:, k])) <= SAME for j in kept):
            kept.append(int(k))
    return kept


def _blocks(columns: Sequence[Array]) -> Array:
    """Return columns of several records below each other, each with a column of its own."""
    found = np.zeros((sum(len(x) for x in columns), len(columns)))
    begin = 0
    for k, x in enumerate(columns):
        found[begin : begin + len(x), k] = x[:, 0]
        begin += len(x)
    return found
