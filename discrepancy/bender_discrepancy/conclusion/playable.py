"""The drive of a compiled simulation as a record that an FMU can be played: both then read the same instants."""

import numpy as np

from bender_compiled.simulation import Drive
from bender_loop.records.between_rows import Exposed
from bender_loop.records.drive import dense
from bender_loop.records.record import Record


def playable(drive: Drive) -> tuple[Record, Exposed]:
    """Return a record with a row at every instant that is read and every command, and how readings follow from it.

    The plant is at 0 V before the first command acts.
    """
    instants, volts = drive.path(drive.voltage_V)
    times, voltage, read = dense(drive.row_time_s, instants, volts, linear=drive.linear, exposure_s=drive.exposure_s)
    return Record(times, voltage, np.full_like(times, np.nan)), read
