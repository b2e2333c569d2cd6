"""A plant driven on an even raster, as a host drives it that knows one step only."""

import math

import numpy as np
from numpy.typing import NDArray

from bender_loop.control.plant import Plant, restart
from bender_loop.fmu.elsewhere import at_the_plant
from bender_loop.records.between_rows import exposed, is_even

Array = NDArray[np.float64]
Places = NDArray[np.intp]

POINTS = 4
"""Instants of the raster that a reading between them is taken from."""
NEAR = 1e-6
"""Of a step; what is nearer to an instant of the raster than that is at it."""
EVEN = 1e-3
"""Of a row or a step: rows so near to an even raster are on it. Times are printed to microseconds, as a rule."""


def raster_step_s(row_time_s: Array, longest_s: float) -> float:
    """Return the longest step that fits a whole number of times between even rows and is no longer than asked.

    Rows that are not even give the median of their distances. That of printed times is off by their last digit, and a
    raster of it would leave the rows behind.
    """
    row_s = float(np.median(np.diff(row_time_s))) if row_time_s.size > 1 else longest_s
    if row_time_s.size > 1 and is_even(row_time_s, EVEN):
        row_s = float(np.ptp(row_time_s)) / (row_time_s.size - 1)
    return row_s / max(1, math.ceil(row_s / longest_s * (1.0 - 1e-9)))


@at_the_plant
def drive_raster(
    plant: Plant,
    row_time_s: Array,
    command_time_s: Array,
    voltage_V: Array,
    linear: bool,
    step_s: float,
    exposure_s: float = 0.0,
) -> Array:
    """Drive a plant from rest on a raster, under the mean of the command over each of its steps.

    Steps under the same command are taken as one, up to the instants that the readings need: the plant has to take
    steps that are multiples of the raster's, and to do the same then, as a container does with an inner step.

    Args:
        plant: reset first.
        row_time_s: (n,) instants of the readings, increasing.
        command_time_s: (m,) instants from which the commands act; 0 V before the first one.
        voltage_V: (m,) commands.
        linear: the command runs straight from each to the next instead of being held.
        step_s: of the raster, which begins with the first reading or command.
        exposure_s: a reading is the mean over this time around its instant; 0 for a snapshot.

    Returns:
        (n,) displacement_um. Between two instants of the raster it is straight where the command runs, and the cubic
        through instants under the same command where that is held: a reading at the instant of a command knows nothing
        of it.

    Raises:
        RunError: the plant failed.
    """
    if exposure_s > 0.0:
        read = exposed(row_time_s, exposure_s)
        return read.readings(_drive(plant, read.instants_s, command_time_s, voltage_V, linear, step_s))
    return _drive(plant, row_time_s, command_time_s, voltage_V, linear, step_s)


def _drive(
    plant: Plant, row_time_s: Array, command_time_s: Array, voltage_V: Array, linear: bool, step_s: float
) -> Array:
    start = min(float(row_time_s[0]), float(command_time_s[0]))
    if not linear:
        row_time_s, command_time_s = (_on_raster(x, start, step_s) for x in (row_time_s, command_time_s))
    count = max(1, math.ceil((float(row_time_s[-1]) - start) / step_s * (1.0 - 1e-9)))
    ends = start + step_s * np.arange(count + 1, dtype=np.float64)
    held = np.diff(_area(ends, command_time_s, voltage_V, linear)) / step_s
    if linear:
        found = _driven(plant, held, np.arange(count + 1), start, step_s)
        return np.interp(row_time_s, ends, found)
    # commands that stand on the raster keep their digits
    digits = 1e-12 * max(float(np.max(np.abs(voltage_V))), 1e-300)
    steady = _value(ends[:-1] + 0.5 * step_s, command_time_s, voltage_V)
    held = np.where(np.abs(held - steady) < 1e3 * digits, steady, held)
    first, last = _stencils(row_time_s, command_time_s, held, start, step_s)
    needed = np.zeros(count + 1, dtype=np.bool_)
    for shift in range(POINTS):
        needed[np.minimum(first + shift, last)] = True
    found = _driven(plant, held, np.flatnonzero(needed), start, step_s)
    return _through(found, first, last, (row_time_s - start) / step_s)


def _on_raster(times: Array, start_s: float, step_s: float) -> Array:
    """Return times (n,) with those at the instants of a raster that are off by no more than printed digits."""
    place = (times - start_s) / step_s
    nearest = np.round(place)
    return np.where(np.abs(place - nearest) <= EVEN, start_s + step_s * nearest, times)


def _driven(plant: Plant, held: Array, needed: Places, start_s: float, step_s: float) -> Array:
    """Return the readings (count + 1,) at those instants of the raster that are needed, NaN at the others."""
    found = np.full(held.size + 1, math.nan)
    found[0] = restart(plant, start_s)
    changes = np.flatnonzero(np.diff(held)) + 1
    stops = np.union1d(np.union1d(changes, needed), [held.size]).astype(np.intp)
    before = 0
    for stop in stops[stops > 0].tolist():
        found[stop] = plant.step(float(held[before]), (stop - before) * step_s)
        before = stop
    return found


def _stencils(
    row_time_s: Array, command_time_s: Array, held: Array, start_s: float, step_s: float
) -> tuple[Places, Places]:
    """Return for every reading the first and last instant of the raster that tell of it, at most `POINTS` of them.

    They lie under the command that acts just before the reading. What is read at the instant of a change is still the
    answer to the command before.
    """
    changes = np.flatnonzero(np.diff(held)) + 1
    # a run of equal steps from one change to the next: it shows at the instants after its first one
    begins, ends = np.concatenate([[0], changes]), np.concatenate([changes, [held.size]])
    place = (row_time_s - start_s) / step_s
    at_start = place <= NEAR
    # a command inside a step of the raster makes a run of one step, which no reading lies in: it is before or behind
    acting = np.searchsorted(command_time_s, row_time_s - NEAR * step_s, side="left") - 1
    acts_from = np.where(acting < 0, 0.0, (command_time_s[np.maximum(acting, 0)] - start_s) / step_s)
    run = np.searchsorted(begins, np.ceil(acts_from - NEAR), side="right") - 1
    low, high = begins[run] + 1, ends[run]
    # too short to hold an instant: the step that has the reading
    cell = np.clip(np.ceil(place - NEAR).astype(np.intp), 1, held.size)
    is_empty = (low > high) | (high < cell - 1) | (low > cell + 1)
    low, high = np.where(is_empty, cell - 1, low), np.where(is_empty, cell, high)
    first = np.clip(cell - POINTS // 2, low, np.maximum(high - POINTS + 1, low))
    last = np.minimum(first + POINTS - 1, high)
    first, last = np.where(at_start, 0, first), np.where(at_start, 0, last)
    return first.astype(np.intp), last.astype(np.intp)


def _through(found: Array, first: Places, last: Places, place: Array) -> Array:
    """Return the values (n,) at places between instants of the raster, by Lagrange's polynomial."""
    total = np.zeros(place.size)
    for k in range(POINTS):
        weight = np.where(first + k <= last, 1.0, 0.0)
        for j in range(POINTS):
            if j != k:
                other = np.where(first + j <= last, (place - first - j) / (k - j), 1.0)
                weight = weight * other
        total += np.where(weight != 0.0, found[np.minimum(first + k, last)], 0.0) * weight
    return total


def _value(times: Array, command_time_s: Array, voltage_V: Array) -> Array:
    place = np.searchsorted(command_time_s, times, side="right") - 1
    return np.where(place < 0, 0.0, voltage_V[np.maximum(place, 0)])


def _area(times: Array, command_time_s: Array, voltage_V: Array, linear: bool) -> Array:
    """Return the integral of the command from its first instant to every time, 0 before."""
    between = np.diff(command_time_s)
    over = 0.5 * (voltage_V[1:] + voltage_V[:-1]) if linear else voltage_V[:-1]
    until = np.concatenate([[0.0], np.cumsum(over * between)])
    place = np.clip(np.searchsorted(command_time_s, times, side="right") - 1, 0, voltage_V.size - 1)
    past = np.maximum(times - command_time_s[place], 0.0)
    slope = np.append(np.diff(voltage_V) / between, 0.0) if linear else np.zeros_like(voltage_V)
    return until[place] + past * (voltage_V[place] + 0.5 * slope[place] * past)
