"""A record played through a plant: the reading that the plant would have given at every row."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bender_loop.control.plant import Plant, restart
from bender_loop.fmu.elsewhere import at_the_plant
from bender_loop.records.acting_voltage import acting_V
from bender_loop.records.drive import InputHold, drive_record, rows_of, steps_of_drive
from bender_loop.records.initial_motion import clearly_better, reflected, starts_at_rest
from bender_loop.records.missing_rows import completed
from bender_loop.records.record import Record

Array = NDArray[np.float64]
Start = Literal["rest", "motion", "untimed"]

FIRST_HOLD_S, LONGEST_HOLD_S = 1.0, 128.0
"""A voltage of an untimed record is held for one second, then as long again as before, until the reading rests."""
RESTING_UM = 1e-7
"""A reading that changes by less than this rests."""


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """What came out, arrays of shape (n,).

    Attributes:
        simulated_um: the plant's reading at each row.
        acting_V: the voltage that was acting when the row was read.
        start: "rest" at 0 V, in "motion" (with a lead-in, see `replay`), or "untimed".
    """

    simulated_um: Array
    acting_V: Array
    start: Start


def replay(plant: Plant, record: Record, *, input_hold: InputHold = "hold", untimed: bool = False) -> Replay:
    """Drive `plant` with the voltage of `record` and read it where the record was read.

    A record may start in the middle of a motion. Its start is then estimated: the voltage is continued backwards by
    reflection at its first point, v(-t) = 2 v(0) - v(t), within the voltages that the record reaches. That lead-in is
    taken only when the first readings of the record are met clearly better than from rest.

    Of an untimed record, each row is a settled pair: its voltage is held until the plant rests, then it is read.

    Rows that are missing are driven through, see `missing_rows`.

    Raises:
        RunError: the plant failed.
    """
    if untimed:
        return Replay(_settled(plant, record.voltage_V), record.voltage_V, "untimed")
    whole = completed(record)
    if whole is not record and whole.made_up is not None:
        there = ~whole.made_up
        found = replay(plant, whole, input_hold=input_hold)
        return replace(found, simulated_um=found.simulated_um[there], acting_V=found.acting_V[there])
    from_rest_um = drive_record(plant, record, input_hold=input_hold)
    at_rest = starts_at_rest(record.voltage_V)
    in_motion_um = from_rest_um if at_rest else _with_lead_in(plant, record, input_hold)
    in_motion = clearly_better(record, in_motion_um, from_rest_um)
    return Replay(
        in_motion_um if in_motion else from_rest_um,
        _acting_V(record, input_hold, in_motion),
        "motion" if in_motion else "rest",
    )


def steps_of_replay(record: Record, input_hold: InputHold = "hold") -> int:
    """Return how many steps of the plant `replay` takes, at the most, for a record that is timed."""
    record = completed(record)
    count = steps_of_drive(*rows_of(record, input_hold)[:4])
    if starts_at_rest(record.voltage_V):
        return count
    return count + steps_of_drive(*rows_of(_led(record), input_hold)[:4])


def _acting_V(record: Record, input_hold: InputHold, in_motion: bool) -> Array:
    """Return the voltage that acts when each row is read; before a motion's first row that of its lead-in."""
    command_s = record.time_s if record.command_time_s is None else record.command_time_s
    lead_s, lead_V = reflected(record.time_s, record.voltage_V) if in_motion else (np.empty(0), np.empty(0))
    times, volts = np.concatenate([lead_s, command_s]), np.concatenate([lead_V, record.voltage_V])
    return acting_V(record.time_s, times, volts, input_hold != "hold")


@at_the_plant
def _settled(plant: Plant, voltage_V: Array) -> Array:
    restart(plant)
    return np.array([_settle(plant, voltage) for voltage in voltage_V.tolist()])


def _settle(plant: Plant, voltage_V: float) -> float:
    reading_um, held_s = plant.step(voltage_V, FIRST_HOLD_S), FIRST_HOLD_S
    while held_s < LONGEST_HOLD_S:
        before_um, reading_um = reading_um, plant.step(voltage_V, held_s)
        held_s *= 2.0
        if abs(reading_um - before_um) < RESTING_UM:
            break
    return reading_um


def _with_lead_in(plant: Plant, record: Record, input_hold: InputHold) -> Array:
    return drive_record(plant, _led(record), input_hold=input_hold)[-len(record) :]


def _led(record: Record) -> Record:
    """Return a record with rows before its own, none of which was read."""
    lead_s, lead_V = reflected(record.time_s, record.voltage_V)
    acting_s = record.command_time_s
    time_s = np.concatenate([lead_s, record.time_s])
    return Record(
        time_s,
        np.concatenate([lead_V, record.voltage_V]),
        np.full_like(time_s, np.nan),
        command_time_s=None if acting_s is None else np.concatenate([lead_s, acting_s]),
        exposure_s=np.full_like(time_s, record.exposure) if record.exposure else None,
        further=tuple(
            replace(x, values=np.append(np.full_like(lead_s, x.values[0]), x.values)) for x in record.further
        ),
    )
