"""A plant driven open loop with the voltage of a record."""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_loop.control.plant import Plant, restart
from bender_loop.fmu.elsewhere import at_the_plant
from bender_loop.records.record import Record

Array = NDArray[np.float64]
InputHold = Literal["hold", "linear"]

# A ramp ends with a sliver under its end value, so that a plant with direct feedthrough is read there.
_SLIVER = 1e-3


def drive_record(plant: Plant, record: Record, *, input_hold: InputHold = "hold", ramp_steps: int = 16) -> Array:
    """`drive` with the columns of `record`."""
    return drive(
        plant,
        record.time_s,
        record.voltage_V,
        command_time_s=record.command_time_s,
        input_hold=input_hold,
        ramp_steps=ramp_steps,
    )


@at_the_plant
def drive(
    plant: Plant,
    time_s: ArrayLike,
    voltage_V: ArrayLike,
    *,
    command_time_s: ArrayLike | None = None,
    input_hold: InputHold = "hold",
    ramp_steps: int = 16,
) -> Array:
    """Drive `plant` from rest and read it where the record was read.

    The plant's clock starts with the first row, at rest under 0 V. Row k is read before voltage k acts.

    Args:
        plant: reset first, and left at the last row.
        time_s: (n,) times of the rows, strictly increasing, steps may be uneven.
        voltage_V: (n,) commands.
        command_time_s: (n,) when each command begins to act, within its row; None for time_s.
        input_hold: "hold" keeps a command until the next one; "linear" runs straight from one to the next.
        ramp_steps: plant steps in which a straight run between two of these times is followed.

    Returns:
        (n,) displacement_um.

    Raises:
        ValueError: an argument is out of its range.
        RunError: the plant failed.
    """
    time = np.asarray(time_s, dtype=float)
    voltage = np.asarray(voltage_V, dtype=float)
    acting = time if command_time_s is None else np.asarray(command_time_s, dtype=float)
    if not (len(time) == len(voltage) == len(acting)):
        raise ValueError(f"columns must have equal lengths, found {len(time)}, {len(voltage)} and {len(acting)}")
    if input_hold not in ("hold", "linear"):
        raise ValueError(f"input_hold must be 'hold' or 'linear', found {input_hold!r}")
    if ramp_steps < 1:
        raise ValueError(f"ramp_steps must be at least 1, found {ramp_steps!r}")
    starts, ends = _held(voltage) if input_hold == "hold" else _ramped(time, acting, voltage)
    steps = _durations(time, None if command_time_s is None else acting)
    reading = restart(plant)
    readings = [reading]
    for row in zip(steps, starts.tolist(), ends.tolist(), strict=True):
        for step, start, end in zip(*row, strict=True):
            if step > 0.0:
                reading = plant.step(end, step) if start == end else _ramp(plant, step, start, end, ramp_steps)
        readings.append(reading)
    return np.array(readings)


# Between two rows lie two stretches, before and after the command begins to act: arrays of shape (n - 1, 2).


def _durations(time: Array, acting: Array | None) -> list[tuple[float, float]]:
    if acting is None:
        return [(0.0, step) for step in even_steps(time)]
    points = np.column_stack([time, acting]).ravel()[:-1]
    return [(before, after) for before, after in _decimal(np.diff(points)).reshape(-1, 2).tolist()]


def _held(voltage: Array) -> tuple[Array, Array]:
    held = np.column_stack([np.append(0.0, voltage[:-2]), voltage[:-1]])
    return held, held


def _ramped(time: Array, acting: Array, voltage: Array) -> tuple[Array, Array]:
    """Voltages at the ends of the stretches; the last value of a ramp that a row cuts is the row's."""
    between = np.diff(acting)
    part = np.divide(time[1:] - acting[:-1], between, out=np.ones_like(between), where=between > 0.0)
    at_rows = np.append(0.0, voltage[:-1] + np.clip(part, 0.0, 1.0) * np.diff(voltage))
    into = voltage[:-1].copy()
    into[0] = 0.0
    starts = np.column_stack([at_rows[:-1], voltage[:-1]])
    return starts, np.column_stack([into, at_rows[1:]])


def _ramp(plant: Plant, duration_s: float, start_V: float, end_V: float, count: int) -> float:
    step = duration_s * (1.0 - _SLIVER) / count
    for index in range(count):
        plant.step(start_V + (end_V - start_V) * (index + 0.5) * step / duration_s, step)
    return plant.step(end_V, duration_s * _SLIVER)


def even_steps(time_s: Array) -> list[float]:
    """Steps between times, freed from the rounding errors of their differences.

    Times on one raster give one step, so that a plant discretises it once. Others are rounded to whole picoseconds,
    which gives decimal times their decimal differences back.
    """
    count = len(time_s) - 1
    if count < 1:
        return []
    step = float(time_s[-1] - time_s[0]) / count
    raster = time_s[0] + step * np.arange(count + 1)
    rounding = 4.0 * np.spacing(np.abs(time_s).max())
    if np.all(np.abs(time_s - raster) <= max(1e-9 * step, rounding)):
        return [step] * count
    return _decimal(np.diff(time_s)).tolist()


def _decimal(steps: Array) -> Array:
    rounded = np.round(steps, 12)
    return np.where(rounded > 0.0, rounded, steps)
