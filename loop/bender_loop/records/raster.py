"""A plant driven on an even raster, as a host drives it that knows one step only."""

import math

import numpy as np
from numpy.typing import NDArray

from bender_loop.control.plant import Plant, restart
from bender_loop.fmu.elsewhere import at_the_plant

Array = NDArray[np.float64]


def raster_step_s(row_time_s: Array, longest_s: float) -> float:
    """Return the longest step that fits a whole number of times between even rows and is no longer than asked.

    Rows that are not even give the median of their distances.
    """
    between = float(np.median(np.diff(row_time_s))) if row_time_s.size > 1 else longest_s
    even = float(np.ptp(row_time_s)) / max(row_time_s.size - 1, 1)
    row_s = even if abs(even - between) <= 1e-6 * between else between
    return row_s / max(1, math.ceil(row_s / longest_s * (1.0 - 1e-9)))


@at_the_plant
def drive_raster(
    plant: Plant, row_time_s: Array, command_time_s: Array, voltage_V: Array, linear: bool, step_s: float
) -> Array:
    """Drive a plant from rest in equal steps, under the mean of the command over each of them.

    Args:
        plant: reset first.
        row_time_s: (n,) instants of the readings, increasing.
        command_time_s: (m,) instants from which the commands act; 0 V before the first one.
        voltage_V: (m,) commands.
        linear: the command runs straight from each to the next instead of being held.
        step_s: of the raster, which begins with the first reading or command.

    Returns:
        (n,) displacement_um, straight between two instants of the raster.

    Raises:
        RunError: the plant failed.
    """
    start = min(float(row_time_s[0]), float(command_time_s[0]))
    count = max(1, math.ceil((float(row_time_s[-1]) - start) / step_s * (1.0 - 1e-9)))
    ends = start + step_s * np.arange(count + 1, dtype=np.float64)
    held = np.diff(_area(ends, command_time_s, voltage_V, linear)) / step_s
    # commands that stand on the raster keep their digits
    digits = 1e-12 * max(float(np.max(np.abs(voltage_V))), 1e-300)
    steady = _value(ends[:-1] + 0.5 * step_s, command_time_s, voltage_V)
    if not linear:
        held = np.where(np.abs(held - steady) < 1e3 * digits, steady, held)
    found = np.empty(count + 1)
    found[0] = restart(plant, start)
    for k, volts in enumerate(held.tolist()):
        found[k + 1] = plant.step(volts, step_s)
    return np.interp(row_time_s, ends, found)


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
