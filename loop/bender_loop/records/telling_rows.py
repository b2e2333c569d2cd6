"""Rows of a long record that show what is quick and what is slow: short stretches of rows from all over it.

Consecutive rows show noise, ringing and delays as all rows would. A third of the stretches are a sample of the record
as it is. A third lie where something moves: behind a change of the command by d volts, what answers over the logarithm
of time moves by d / t per second, t after it. So a hold is seen for as long as it lasts, each decade of times as
closely as the one before it, and a ramp all along. A third lie right behind corners of the command, by their height:
steps, turns.

The sample is random within equal parts of that measure (stratified, Neyman 1934, doi:10.2307/2342192): no cycle of the
command falls in with it, so that every phase is seen.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]

STRETCH_ROWS = 25
AS_GOOD = 0.9
"""Of what the window that shows most shows: an earlier one that shows so much is taken."""
LEAST_PART = 0.05
"""Of a window: one that is longer by less is not sought."""


def telling_rows(command_V: Array, read: Mask, most: int) -> Rows:
    """Return at most so many rows of a record that show what is quick and what is slow, in their order.

    Args:
        command_V: (n,) of every row.
        read: (n,) which rows have a reading.
        most: rows.
    """
    if most >= command_V.size:
        return np.arange(command_V.size)
    begins = np.arange(0, command_V.size, STRETCH_ROWS)
    measures = (np.ones(command_V.size), _movement(command_V), _corners(command_V))
    weights = np.sum([_parts(np.add.reduceat(x * read, begins)) for x in measures], axis=0)
    # the record begins in the first one
    weights[0] = np.inf
    chosen = begins[_sampled(weights, max(most // STRETCH_ROWS, 1))]
    rows = (chosen[:, None] + np.arange(STRETCH_ROWS)).ravel()
    return rows[rows < command_V.size]


def _movement(command_V: Array) -> Array:
    """Return how much may be moving in every row (n,): each change of the command before it over its age in rows."""
    from scipy.signal import fftconvolve

    changes = np.abs(np.diff(command_V, prepend=command_V[:1]))
    answer = 1.0 / np.arange(1.0, changes.size + 1.0)
    return np.maximum(fftconvolve(changes, answer)[: changes.size], 0.0)


def _corners(command_V: Array) -> Array:
    """Return the heights of the corners of the command that lie no more than a stretch before every row (n,)."""
    corners = np.abs(np.diff(command_V, 2, prepend=command_V[:1], append=command_V[-1:]))
    until = np.concatenate([np.zeros(STRETCH_ROWS), np.cumsum(corners)])
    return until[STRETCH_ROWS:] - until[:-STRETCH_ROWS]


def _parts(values: Array) -> Array:
    total = float(values.sum())
    return values / total if total > 0.0 else np.full(values.size, 1.0 / values.size)


def _sampled(weights: Array, count: int) -> Rows:
    """Return about so many places, each as likely as its weight says and none twice."""
    if count >= weights.size:
        return np.arange(weights.size)
    certain = np.isinf(weights)
    while True:
        left = count - int(certain.sum())
        total = float(weights[~certain].sum())
        if left <= 0 or total <= 0.0:
            return np.flatnonzero(certain)
        more = ~certain & (weights * left >= total)
        if not more.any():
            break
        certain |= more
    others = np.flatnonzero(~certain)
    course = np.cumsum(weights[others])
    drawn = (np.arange(left) + np.random.default_rng(0).random(left)) * (float(course[-1]) / left)
    places = others[np.minimum(np.searchsorted(course, drawn), others.size - 1)]
    return np.unique(np.concatenate([np.flatnonzero(certain), places]))


def telling_window(command_V: Array, read: Mask, most_rows: int, most_changes: int) -> slice:
    """Return the longest window of so many rows and changes of the command at most that shows most of a record.

    Args:
        command_V: (n,) of every row.
        read: (n,) which rows have a reading.
        most_rows: of the window.
        most_changes: of the command within it.
    """
    moves = np.cumsum(np.diff(command_V, prepend=command_V[:1]) != 0.0)
    most = min(command_V.size, most_rows)

    def of(rows: int) -> tuple[int, int]:
        begin = first_row(command_V, read, rows)
        return begin, int(moves[begin + rows - 1] - moves[begin])

    begin, changes = of(most)
    if changes <= most_changes:
        return slice(begin, begin + most)
    # so many rows have no more changes, wherever they are
    rows = min(most_changes + 1, most)
    begin, step = of(rows)[0], (most - rows) // 2
    while step >= LEAST_PART * rows:
        first, changes = of(rows + step)
        if changes <= most_changes:
            begin, rows = first, rows + step
        step //= 2
    return slice(begin, begin + rows)


def changing_commands(command_V: Array, linear: bool) -> Rows:
    """Return which commands tell the course of all of them: one that repeats its neighbours changes nothing.

    Args:
        command_V: (n,) of every row.
        linear: the command runs straight from each to the next.
    """
    told = np.diff(command_V, prepend=np.nan) != 0.0
    if linear:
        told |= np.diff(command_V, append=np.nan) != 0.0
    return np.flatnonzero(told)


def first_row(command_V: Array, read: Mask, rows: int) -> int:
    """Return the first row of the earliest window of so many rows that shows nearly as much of a record as any other.

    Args:
        command_V: (n,) of every row.
        read: (n,) which rows have a reading.
        rows: of the window.
    """
    if rows >= command_V.size:
        return 0
    shown = shown_parts(command_V, read, rows)
    return int(np.argmax(shown >= AS_GOOD * float(shown.max())))


def shown_parts(command_V: Array, read: Mask, rows: int) -> Array:
    """Return what part of a record's spectrum and amplitudes every window of so many rows shows, shape (n - rows + 1,).

    Of the spectrum: for each octave of times, the mean square change of the command over such a time before a reading
    in the window, as far as it reaches that of the record (a spectrum by Haar's wavelets). Of the amplitudes: the range
    of the window's commands in parts of that of the record.
    """
    span_V = float(np.ptp(command_V))
    if span_V == 0.0:
        return np.ones(command_V.size - rows + 1)
    octaves = [shown for k in range(rows.bit_length()) if (shown := _octave(command_V, read, rows, 2**k)) is not None]
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    size, origin = rows, -(rows // 2)
    ranges = maximum_filter1d(command_V, size, origin=origin) - minimum_filter1d(command_V, size, origin=origin)
    spectrum = np.mean(octaves, axis=0) if octaves else 1.0
    return spectrum * ranges[: command_V.size - rows + 1] / span_V


def _octave(command_V: Array, read: Mask, rows: int, lag: int) -> Array | None:
    """Return how far each window reaches the record's mean square change over so many rows; None where that is none."""
    if lag >= command_V.size:
        return None
    changes = np.square(command_V[lag:] - command_V[:-lag]) * read[lag:]
    if not changes.any():
        return None
    cumulated = np.concatenate([np.zeros(lag + 1), np.cumsum(changes)])
    sums = cumulated[rows:] - cumulated[:-rows]
    return np.minimum(sums / rows / float(changes.sum() / command_V.size), 1.0)
