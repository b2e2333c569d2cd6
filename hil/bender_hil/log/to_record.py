"""From the journals of a run to its record: what was on the wire, and when, beside what the camera saw, and when."""

from typing import Any

import numpy as np

from bender_hil.log.journal import Entry
from bender_hil.log.read_run import RunLog
from bender_loop.records.record import Record


def to_record(log: RunLog) -> Record | None:
    """The run as a record; None for fewer than two ticks that reached the supply.

    `time_s` is when the light fell on the frame (as well as the bench file's `delay_s` knows it), `command_time_s` when
    the command of that row was on the wire: the time between is the runner's own and no property of the actuator. A
    command that came after the next frame was taken is entered at that frame, the latest that a row can say; one that
    the slew limit led there in parts is entered at the mean of their times, each with the size of its step as weight,
    which leaves the mean voltage of the row as it was. `exposure_s` is there where the bench file says it.
    """
    applied, measured = log.by_sequence("applied"), log.by_sequence("measured")
    # ticks after the last that the guard took never reached the supply
    newest = max(applied, default=-1)
    rows = _in_order([tick for tick in log.ticks if tick["sequence"] <= newest])
    if len(rows) < 2:
        return None
    delay_s = float(log.start.get("delay_s") or 0.0)
    origin_s = float(rows[0]["grabbed_s"]) - delay_s
    time_s = np.array([row["grabbed_s"] - delay_s - origin_s for row in rows])
    voltage_V, acting_s = _levels(rows, log.all_by_sequence("applied"), origin_s)
    following = np.append(time_s[1:], np.inf)
    columns: dict[str, Any] = {
        "displacement_um": np.array([_number(row["measured_um"]) for row in rows]),
        "command_time_s": np.minimum(np.maximum(acting_s, time_s), following),
        "supply_voltage_V": np.array([_of(measured, row, "supply_voltage_V") for row in rows]),
        "current_A": np.array([_of(measured, row, "current_A") for row in rows]),
    }
    exposure_s = float(log.start.get("exposure_s") or 0.0)
    if 0.0 < exposure_s <= time_s[-1]:
        columns["exposure_s"] = np.full_like(time_s, exposure_s)
    if any(row["setpoint_um"] is not None for row in rows):
        columns["setpoint_um"] = np.array([_number(row["setpoint_um"]) for row in rows])
    for name in ("supply_voltage_V", "current_A"):
        if np.isnan(columns[name]).all():
            del columns[name]
    return Record(time_s, voltage_V, **columns)


def _in_order(ticks: list[Entry]) -> list[Entry]:
    return [tick for k, tick in enumerate(ticks) if k == 0 or tick["grabbed_s"] > ticks[k - 1]["grabbed_s"]]


def _levels(rows: list[Entry], applied: dict[int, list[Entry]], origin_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Voltage on the wire and when it got there; a command that was superseded left the level as it was."""
    levels, times = [], []
    level_V = 0.0
    for row in rows:
        parts = applied.get(row["sequence"], [])
        times.append((mean_time_s(parts, level_V) if parts else row["sent_s"]) - origin_s)
        level_V = float(parts[-1]["voltage_V"]) if parts else level_V
        levels.append(level_V)
    return np.array(levels), np.array(times)


def mean_time_s(parts: list[Entry], before_V: float) -> float:
    """Return when a command acted that came in parts: one step at that time has the same area."""
    steps_V = np.diff([before_V, *(float(part["voltage_V"]) for part in parts)])
    if len(parts) == 1 or not (np.all(steps_V > 0.0) or np.all(steps_V < 0.0)):
        return float(parts[-1]["command_time_s"])
    return float(np.average([float(part["command_time_s"]) for part in parts], weights=np.abs(steps_V)))


def _of(entries: dict[int, Entry], row: Entry, name: str) -> float:
    entry = entries.get(row["sequence"])
    return np.nan if entry is None else _number(entry[name])


def _number(value: float | None) -> float:
    return np.nan if value is None else float(value)
