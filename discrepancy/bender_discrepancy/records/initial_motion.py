"""How a record begins is a hypothesis: from rest, in the middle of a motion, or at a place on a loop.

A first guess is made with the model as given. The search weighs it against the others with the effects that it finds.
A start in motion gives the drive a lead-in.

One sine at one amplitude has been running before as it runs in the record; of anything else, the command is continued
backwards by reflection. Before that it stood at its mean, for long beside the record: what relaxes more slowly shows in
the record as hardly more than a constant.
"""

from dataclasses import replace

import numpy as np

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.records.excitation import one_sine, sine_frequency_Hz
from bender_discrepancy.records.observations import Array, Observations, Start
from bender_loop.records.initial_motion import clearly_better, reflected, starts_at_rest
from bender_loop.records.record import Record
from bender_plant.model import Model, ModelError

STOOD_PER_DURATION = 10.0
LONGEST_STAND_S = 300.0
COARSER = 8.0
# rows of the beginning that are simulated: what comes later says little of it
MOST_ROWS = 200_000
# part of the range: an end that is nearer is no other place on the loop
AWAY = 0.1


def started(base: Model, record: Record, seen: Observations) -> Observations:
    """Return the observations of a record with a lead-in, where the model as given meets its start better then."""
    if starts_at_rest(record.voltage_V):
        return seen
    led, early = in_motion_from(seen), slice(0, MOST_ROWS)
    beginning = Record(record.time_s[early], record.voltage_V[early], record.displacement_um[early])
    try:
        from_rest, in_motion = (
            Simulator(_until(x.drive, beginning), coarser=COARSER).run(base).reading_um for x in (seen, led)
        )
    except (ModelError, ArithmeticError):
        return seen
    return led if clearly_better(beginning, in_motion, from_rest) else seen


def _until(drive: Drive, beginning: Record) -> Drive:
    """Return a drive until the last row of the beginning of a record."""
    rows = len(beginning)
    commands = drive.voltage_V.size - drive.row_time_s.size + rows
    return replace(
        drive,
        row_time_s=drive.row_time_s[:rows],
        command_time_s=drive.command_time_s[:commands],
        voltage_V=drive.voltage_V[:commands],
    )


def in_motion_from(seen: Observations) -> Observations:
    """Return the observations of a record with a lead-in: the motion went on before as it goes on in the record."""
    return replace(seen, drive=_led(seen.drive), start="motion")


def beginnings(record: Record, seen: Observations) -> tuple[Observations, ...]:
    """Return the observations of a record with each beginning that it may have, rest first.

    Args:
        record: as it was read.
        seen: its observations, from rest.
    """
    if starts_at_rest(record.voltage_V):
        return (seen,)
    ends: tuple[tuple[Start, float], ...] = (
        ("from_above", float(np.max(record.voltage_V))),
        ("from_below", float(np.min(record.voltage_V))),
    )
    placed = [
        replace(seen, drive=_coming_from(seen.drive, volts), start=name)
        for name, volts in ends
        if abs(volts - float(record.voltage_V[0])) > AWAY * float(np.ptp(record.voltage_V))
    ]
    return (seen, in_motion_from(seen), *placed)


def _coming_from(drive: Drive, volts: float) -> Drive:
    """Return a drive that stood at one voltage, then at that of the first row, both for long."""
    time_s, voltage_V = drive.row_time_s, drive.voltage_V
    stood_s = min(STOOD_PER_DURATION * float(time_s[-1] - time_s[0]), LONGEST_STAND_S)
    first_s = float(drive.command_time_s[0])
    before_s = np.array([first_s - 2.0 * stood_s, first_s - stood_s])
    command_s = np.concatenate([before_s, drive.command_time_s])
    return replace(drive, command_time_s=command_s, voltage_V=np.concatenate([[volts, voltage_V[0]], voltage_V]))


def _led(drive: Drive) -> Drive:
    time_s, voltage_V = drive.row_time_s, drive.voltage_V
    lead_s, lead_V = reflected(time_s, voltage_V)
    if one_sine(time_s, voltage_V):
        lead_V = _continued(time_s, voltage_V, lead_s)
    stood_s = min(STOOD_PER_DURATION * float(time_s[-1] - time_s[0]), LONGEST_STAND_S)
    before_s = np.concatenate([[lead_s[0] - stood_s], lead_s])
    before_V = np.concatenate([[float(voltage_V.mean())], lead_V])
    command_s = np.concatenate([before_s, drive.command_time_s])
    return replace(drive, command_time_s=command_s, voltage_V=np.concatenate([before_V, voltage_V]))


def _continued(time_s: Array, voltage_V: Array, lead_s: Array) -> Array:
    """Return the commands of a periodic record before its first row, whole periods earlier."""
    period_s = 1.0 / sine_frequency_Hz(time_s, voltage_V)
    later = lead_s + period_s * np.ceil((time_s[0] - lead_s) / period_s)
    return np.interp(later, time_s, voltage_V)
