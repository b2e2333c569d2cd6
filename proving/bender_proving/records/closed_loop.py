"""Records of a closed loop: a controller of its own follows set-points with the readings of the hidden bench.

The bench is simulated from its beginning for every stretch of rows, since its integrator knows no other start. Within
a stretch commands and readings are iterated until they agree: a reading depends on earlier commands alone, so every
round settles at least one row more. Each round foretells what its own commands will change of the readings, by the
bench's answer to one step: what they agree on is the same whatever is foretold, but most rows settle in a few rounds.
"""

from collections.abc import Callable

import numpy as np
from bender_proving.cases.hidden import log_uniform
from bender_proving.cases.nominal import FULL_STROKE_UM, FULL_VOLTAGE_V
from bender_proving.physics.lobatto import Array
from bender_proving.records.excitation import RATE_HZ, Excitation, even
from numpy.random import Generator

DURATION_S = 60.0
ROWS = round(DURATION_S * RATE_HZ["camera"])
_STRETCH = 450
_TUNINGS = 4
# the step whose answer foretells readings: from, to, at which row, followed for so many
_LOW_V, _HIGH_V, _STEP_ROW, _FOLLOWED = 15.0, 25.0, 60, 60
# of the rows
_JUMPS = 0.02
_SLOPE_UM_PER_V = FULL_STROKE_UM / FULL_VOLTAGE_V


def played(rng: Generator, seen_um: Callable[[Excitation], Array]) -> Excitation:
    """Return what a PI controller commands before the camera; one that swings from end to end is tuned down first.

    Args:
        rng: draws gains and set-points.
        seen_um: the readings of a plan, noise included, shape of its rows.
    """
    bandwidth_rad_per_s = 2.0 * np.pi * log_uniform(rng, 0.1, 0.5)
    integral, proportional = bandwidth_rad_per_s / _SLOPE_UM_PER_V, float(rng.uniform(0.0, 0.4)) / _SLOPE_UM_PER_V
    target_um = _set_points(rng)
    answer_um_per_V = _answer(seen_um)
    voltage_V = _followed(target_um, proportional, integral, seen_um, answer_um_per_V)
    for tuning in range(1, _TUNINGS):
        if not swings(voltage_V):
            break
        slower = 0.5**tuning
        voltage_V = _followed(target_um, slower * proportional, slower * integral, seen_um, answer_um_per_V)
    return even("camera", voltage_V)


def swings(voltage_V: Array) -> bool:
    """Return whether commands jump over half of the range from row to row, more often than set-points do.

    Nobody records such a loop: all that its rows hold is the two ends of the supply.
    """
    return float(np.mean(np.abs(np.diff(voltage_V)) > 0.5 * FULL_VOLTAGE_V)) > _JUMPS


def _answer(seen_um: Callable[[Excitation], Array]) -> Array:
    """Return how the readings answer to a command of 1 V that lasts for one row, from the next row on."""
    held_V = np.full(_STEP_ROW + 1 + _FOLLOWED, _LOW_V)
    stepped_V = held_V.copy()
    stepped_V[_STEP_ROW:] = _HIGH_V
    rise_um = seen_um(even("camera", stepped_V)) - seen_um(even("camera", held_V))
    return np.nan_to_num(np.diff(rise_um[_STEP_ROW:])) / (_HIGH_V - _LOW_V)


def _followed(
    target_um: Array,
    proportional: float,
    integral: float,
    seen_um: Callable[[Excitation], Array],
    answer_um_per_V: Array,
) -> Array:
    voltage_V = np.zeros(ROWS)
    for end in range(_STRETCH, ROWS + _STRETCH, _STRETCH):
        stop = min(end, ROWS)
        for _ in range(_STRETCH + 1):
            played_V = voltage_V[:stop].copy()
            error_um = target_um[:stop] - seen_um(even("camera", played_V))
            voltage_V[:stop] = _commanded(
                error_um, played_V, answer_um_per_V, proportional, integral / RATE_HZ["camera"]
            )
            if np.array_equal(voltage_V[:stop], played_V):
                break
        else:
            raise AssertionError(f"the loop did not agree with itself within {_STRETCH + 1} rounds")
        voltage_V[stop:] = voltage_V[stop - 1]
    return voltage_V


def _set_points(rng: Generator) -> Array:
    """Levels held and ramps between them, over most of the stroke; zero for the first half second."""
    targets = np.zeros(ROWS)
    row = round(0.5 * RATE_HZ["camera"])
    level_um = 0.0
    while row < ROWS:
        next_um, count = float(rng.uniform(0.05, 0.9)) * FULL_STROKE_UM, int(rng.integers(20, 120))
        ramp = count // 2 if rng.random() < 0.4 else 0
        course = np.concatenate([np.linspace(level_um, next_um, ramp), np.full(count - ramp, next_um)])
        targets[row : row + count] = course[: ROWS - row]
        row, level_um = row + count, next_um
    return targets


def _commanded(
    seen_error_um: Array, played_V: Array, answer_um_per_V: Array, proportional: float, integral: float
) -> Array:
    """Return the commands row by row, in mV steps; the integral stands still where the supply is at its end.

    Where a spring gave way there is no reading, and nothing more is commanded: no case is made of such a loop.

    Args:
        seen_error_um: set-point minus reading under the commands of the round before.
        played_V: those commands; where the ones before a row differ, its reading is foretold to follow them.
        answer_um_per_V: of the readings to a command of one row.
        proportional: gain, V/um.
        integral: gain of one row, V/um.
    """
    commands = np.zeros_like(seen_error_um)
    changed_V = np.zeros_like(seen_error_um)
    held = 0.0
    for k, seen in enumerate(seen_error_um):
        if np.isnan(seen):
            break
        count = min(k, answer_um_per_V.size)
        error = seen - float(answer_um_per_V[:count] @ changed_V[k - count : k][::-1])
        wanted = held + integral * error + proportional * error
        commands[k] = round(min(max(wanted, 0.0), FULL_VOLTAGE_V), 3)
        changed_V[k] = commands[k] - played_V[k]
        if 0.0 < wanted < FULL_VOLTAGE_V or wanted * error < 0.0 or held == 0.0:
            held = min(max(held + integral * error, 0.0), FULL_VOLTAGE_V)
    return commands
