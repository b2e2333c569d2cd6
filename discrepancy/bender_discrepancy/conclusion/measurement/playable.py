"""The drive of a compiled simulation as a record that an FMU can be played: both then read the same instants."""

import math

import numpy as np

from bender_compiled.simulation import Array, Drive
from bender_loop.records.between_rows import Exposed
from bender_loop.records.drive import dense
from bender_loop.records.record import Record
from bender_plant.model import Model
from bender_plant.plant import longest_step_s

ROOM = 0.5
"""Of the longest step that a plant takes: what is used of it."""


def playable_for(model: Model, drive: Drive) -> tuple[Record, Exposed]:
    """Return a drive as `playable` does, in steps that the plant of a model takes."""
    return playable(drive, ROOM * longest_step_s(model))


def playable(drive: Drive, longest_s: float = math.inf) -> tuple[Record, Exposed]:
    """Return a record with a row at every instant that is read and every command, and how readings follow from it.

    The plant is at 0 V before the first command acts.

    Args:
        drive: of the simulation.
        longest_s: between two commands, as a plant takes it in one step. What stands longer is commanded again.
    """
    instants, volts = _in_parts(*drive.path(drive.voltage_V), longest_s, drive.linear)
    times, voltage, read = dense(drive.row_time_s, instants, volts, linear=drive.linear, exposure_s=drive.exposure_s)
    return Record(times, voltage, np.full_like(times, np.nan)), read


def _in_parts(instants_s: Array, volts: Array, longest_s: float, linear: bool) -> tuple[Array, Array]:
    """Return a path with commands between those that are further apart than `longest_s`."""
    parts = np.maximum(np.ceil(np.diff(instants_s) / longest_s), 1.0).astype(np.int64)
    if not np.any(parts > 1):
        return instants_s, volts
    first = np.repeat(np.cumsum(parts) - parts, parts)
    fraction = (np.arange(first.size) - first) / np.repeat(parts, parts)
    begins, lengths = np.repeat(instants_s[:-1], parts), np.repeat(np.diff(instants_s), parts)
    times = np.append(begins + fraction * lengths, instants_s[-1])
    if linear:
        return times, np.interp(times, instants_s, volts)
    return times, volts[np.searchsorted(instants_s, times, side="right") - 1]
