"""Records that start in the middle of a motion: their drive gets a lead-in where the readings speak for one.

One sine at one amplitude has been running before as it runs in the record; of anything else, the command is continued
backwards by reflection. Before that it stood at its mean, for long beside the record: what relaxes more slowly shows in
the record as hardly more than a constant.
"""

from dataclasses import replace

import numpy as np

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.records.excitation import one_sine, sine_frequency_Hz
from bender_discrepancy.records.observations import Array, Observations
from bender_loop.records.initial_motion import clearly_better, reflected, starts_at_rest
from bender_loop.records.record import Record
from bender_plant.model import Model, ModelError

STOOD_PER_DURATION = 10.0
LONGEST_STAND_S = 300.0
COARSER = 8.0


def started(base: Model, record: Record, seen: Observations) -> Observations:
    """Return the observations of a record with a lead-in, where the model as given meets its start better then."""
    if starts_at_rest(record.voltage_V):
        return seen
    led = replace(seen, drive=_led(seen.drive))
    try:
        from_rest, in_motion = (Simulator(x.drive, coarser=COARSER).run(base).reading_um for x in (seen, led))
    except (ModelError, ArithmeticError):
        return seen
    return led if clearly_better(record, in_motion, from_rest) else seen


def _led(drive: Drive) -> Drive:
    time_s, voltage_V = drive.row_time_s, drive.voltage_V
    lead_s, lead_V = reflected(time_s, voltage_V)
    if one_sine(time_s, voltage_V):
        lead_V = _continued(time_s, voltage_V, lead_s)
    stood_s = min(STOOD_PER_DURATION * float(time_s[-1] - time_s[0]), LONGEST_STAND_S)
    before_s = np.concatenate([[lead_s[0] - stood_s], lead_s])
    before_V = np.concatenate([[float(voltage_V.mean())], lead_V])
    command_s = np.concatenate([before_s, drive.command_time_s])
    return Drive(time_s, command_s, np.concatenate([before_V, voltage_V]), drive.linear)


def _continued(time_s: Array, voltage_V: Array, lead_s: Array) -> Array:
    """Return the commands of a periodic record before its first row, whole periods earlier."""
    period_s = 1.0 / sine_frequency_Hz(time_s, voltage_V)
    later = lead_s + period_s * np.ceil((time_s[0] - lead_s) / period_s)
    return np.interp(later, time_s, voltage_V)
