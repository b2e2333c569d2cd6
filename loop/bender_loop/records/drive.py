"""A plant driven open loop with the voltage of a record."""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_loop.control.plant import Plant, restart
from bender_loop.fmu.elsewhere import at_the_plant
from bender_loop.records.between_rows import Exposed, exposed, followed
from bender_loop.records.further import follow
from bender_loop.records.record import Record

Array = NDArray[np.float64]
InputHold = Literal["hold", "linear", "smooth"]

# A ramp ends with a sliver under its end value, so that a plant with direct feedthrough is read there.
_SLIVER = 1e-3
# a straight run that begins after 0 V jumps there: the 0 V ends by this much before
_INSTANT_S = 1e-9
_ROWS_AT_A_TIME = 1 << 16


def drive_record(plant: Plant, record: Record, *, input_hold: InputHold = "hold", ramp_steps: int = 16) -> Array:
    """`drive` with the columns of `record`; "smooth" is band-limited between the commands.

    Where frames integrate, a reading is the mean over its exposure. Further inputs follow the record.
    """
    follow(plant, record.time_s, record.further)
    time_s, voltage_V, acting_s, hold, read = rows_of(record, input_hold)
    readings = drive(plant, time_s, voltage_V, command_time_s=acting_s, input_hold=hold, ramp_steps=ramp_steps)
    return readings if read is None else read.readings(readings)


def rows_of(record: Record, input_hold: InputHold) -> tuple[Array, Array, Array | None, InputHold, Exposed | None]:
    """Return times, voltages, when they act and how they are held, as `drive` takes them, and the readings of it.

    The rows of a record that is smooth or whose frames integrate are more than its own.
    """
    if input_hold != "smooth" and record.exposure == 0.0:
        return record.time_s, record.voltage_V, record.command_time_s, input_hold, None
    acting_s = record.time_s if record.command_time_s is None else record.command_time_s
    path = followed(acting_s, record.voltage_V) if input_hold == "smooth" else (acting_s, record.voltage_V)
    linear = input_hold != "hold"
    times, volts, read = dense(record.time_s, *path, linear=linear, exposure_s=record.exposure)
    return times, volts, None, "linear" if linear else "hold", read


def dense(
    row_time_s: Array, command_time_s: Array, voltage_V: Array, *, linear: bool, exposure_s: float = 0.0
) -> tuple[Array, Array, Exposed]:
    """Return rows at every instant that is read and every command, and how readings follow from what is read there.

    Args:
        row_time_s: (n,) of the readings.
        command_time_s: (m,) instants from which the commands act; before the first one 0 V acts.
        voltage_V: (m,) commands.
        linear: the voltage runs straight from command to command.
        exposure_s: a reading is the mean over this time around its instant; 0 for a snapshot.

    Returns:
        Times and voltages, (k,) each, to be driven held or linear, and the readings of them.
    """
    others = [command_time_s]
    first = float(command_time_s[0])
    if linear and row_time_s[0] - 0.5 * exposure_s < first:
        others.append(np.array([first - _INSTANT_S]))
    read = exposed(row_time_s, exposure_s, tuple(others))
    times = read.instants_s
    if linear:
        return times, np.interp(times, command_time_s, voltage_V, left=0.0), read
    command = np.searchsorted(command_time_s, times, side="right") - 1
    return times, np.where(command < 0, 0.0, voltage_V[np.maximum(command, 0)]), read


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
    stretches = _stretches(time, None if command_time_s is None else acting, voltage, input_hold)
    # times increase: every row has a stretch, and the reading after its last one
    rows, sides = np.nonzero(stretches[0] > 0.0)
    readings = np.empty(len(time))
    readings[0] = restart(plant, float(time[0]))
    # lists of numbers are quick to go through and large: a part of them at a time
    for begin in range(0, rows.size, _ROWS_AT_A_TIME):
        part = rows[begin : begin + _ROWS_AT_A_TIME], sides[begin : begin + _ROWS_AT_A_TIME]
        columns = (x[part].tolist() for x in stretches)
        for row, step, start, end in zip((part[0] + 1).tolist(), *columns, strict=True):
            readings[row] = plant.step(end, step) if start == end else _ramp(plant, step, start, end, ramp_steps)
    return readings


def steps_of_drive(
    time_s: Array,
    voltage_V: Array,
    command_time_s: Array | None = None,
    input_hold: InputHold = "hold",
    ramp_steps: int = 16,
) -> int:
    """Return in how many steps of the plant `drive` goes through a record."""
    steps, starts, ends = _stretches(time_s, command_time_s, voltage_V, input_hold)
    return int(np.count_nonzero(steps > 0.0)) + ramp_steps * int(np.count_nonzero((steps > 0.0) & (starts != ends)))


# Between two rows lie two stretches, before and after the command begins to act: arrays of shape (n - 1, 2).


def _stretches(time: Array, acting: Array | None, voltage: Array, input_hold: InputHold) -> tuple[Array, Array, Array]:
    """Return how long each stretch lasts, and the voltages at its start and its end."""
    starts, ends = (
        _held(voltage) if input_hold == "hold" else _ramped(time, time if acting is None else acting, voltage)
    )
    return _durations(time, acting), starts, ends


def _durations(time: Array, acting: Array | None) -> Array:
    if acting is None:
        steps = np.array(even_steps(time))
        return np.column_stack([np.zeros_like(steps), steps])
    points = np.column_stack([time, acting]).ravel()[:-1]
    return _decimal(np.diff(points)).reshape(-1, 2)


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
