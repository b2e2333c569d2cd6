"""What a rig is driven with, and a reading with noise."""

from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from scipy.integrate import solve_ivp

from bender_proving.gallery.rig import Array, RigRecord

RELATIVE, ABSOLUTE, EXPLICIT = 1e-8, 1e-10, 1e-5
Slope = Callable[[float, Array, float], Array]


def levels(values: Array, held: int) -> Array:
    """Return values, each held for so many rows, after a tenth of that at rest."""
    return np.concatenate([np.zeros(max(held // 10, 2)), np.repeat(values, held)])


def read(time_s: Array, drive: Array, clean: Array, noise: float, rng: Generator) -> RigRecord:
    """Return a record with white noise on its readings."""
    return RigRecord(time_s, drive, clean + noise * rng.standard_normal(clean.size))


def integrated(
    slope: Slope, start: Array, time_s: Array, drive: Array, most_step_s: float, method: str = "LSODA"
) -> Array:
    """Return the states (n, k) at every row; each input is held to the next row.

    Args:
        slope: of the state, at a time, a state and an input.
        start: (k,) state at the first row.
        time_s: (n,) of the rows.
        drive: (n,) the inputs.
        most_step_s: of the solver.
        method: of `scipy.integrate.solve_ivp`; an explicit one where the slope jumps.
    """
    states = np.empty((time_s.size, start.size))
    states[0] = start
    changed = np.append(np.flatnonzero(np.diff(drive)) + 1, time_s.size - 1)
    first = 0
    for last in np.unique(changed):
        if last == first:
            continue
        rows, held = slice(first, last + 1), float(drive[first])
        found = solve_ivp(
            lambda t, x, u=held: slope(t, x, u),
            (time_s[first], time_s[last]),
            states[first],
            method=method,
            t_eval=time_s[rows],
            rtol=RELATIVE if method == "LSODA" else EXPLICIT,
            atol=ABSOLUTE if method == "LSODA" else EXPLICIT,
            max_step=most_step_s,
        )
        if not found.success:
            raise RuntimeError(f"a rig of the gallery cannot be integrated: {found.message}")
        states[rows] = found.y.T
        first = int(last)
    return states
