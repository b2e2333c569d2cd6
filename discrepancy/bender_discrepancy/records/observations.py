"""What is to be explained: measured readings, which of them count, and which of them are held out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive
from bender_discrepancy.records.excitation import one_sine
from bender_loop.records.acting_voltage import acting_V
from bender_loop.records.record import Record

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCKS = 20
HELD_OUT_EVERY = 3


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """One record ready for fits.

    Attributes:
        drive: what the plant was driven with.
        measured_um: (n,) readings, NaN where lost.
        usable: (n,) readings that count: neither lost nor outlying.
        held_out: (n,) rows that no fit sees.
        half_step_um: half the step of coarse readings: each says only that the tip lay within this of it.
    """

    drive: Drive
    measured_um: Array
    usable: Mask
    held_out: Mask
    half_step_um: float = 0.0

    def beyond(self, residual: Array) -> Array:
        """Return how far the residual lies outside of what a coarse reading allows."""
        if self.half_step_um == 0.0:
            return residual
        return np.sign(residual) * np.maximum(np.abs(residual) - self.half_step_um, 0.0)

    @property
    def time_s(self) -> Array:
        """Instants of the readings."""
        return self.drive.row_time_s

    @property
    def command_V(self) -> Array:
        """Command of every row; what a lead-in commanded before the first one is left out."""
        return self.drive.voltage_V[-self.measured_um.size :]

    @property
    def acting_V(self) -> Array:
        """The voltage that acted while each row was read, before the row's own command did."""
        x = self.drive
        return acting_V(x.row_time_s, x.command_time_s, x.voltage_V, x.linear)

    @property
    def training(self) -> Mask:
        """Rows that a fit may use."""
        return self.usable & ~self.held_out

    @property
    def judging(self) -> Mask:
        """Rows that a fit is judged on."""
        return self.usable & self.held_out

    def without(self, outlying: Mask) -> "Observations":
        """Return the observations with more rows set aside."""
        return replace(self, usable=self.usable & ~outlying)


def held_out_rows(count: int) -> Mask:
    """Set aside every third of twenty blocks of consecutive rows: all of the record is judged, none in single rows."""
    block = np.minimum(np.arange(count) * BLOCKS // count, BLOCKS - 1)
    return block % HELD_OUT_EVERY == 1


# the slowest of the paper's actuator relaxes within a second
UNTIMED_HOLD_S = 12.0


def observe(record: Record, linear: bool = False, untimed: bool = False) -> Observations:
    """Return the observations of a record: its clock starts at its first row.

    Where the times are only an order, every row is held until whatever relaxes has relaxed.
    """
    usable = np.isfinite(record.displacement_um)
    if untimed:
        times = UNTIMED_HOLD_S * np.arange(len(record), dtype=float)
        drive = Drive.of_rows(times + UNTIMED_HOLD_S, record.voltage_V, times)
        return Observations(drive, record.displacement_um, usable, held_out_rows(len(record)))
    start = record.time_s[0]
    command = record.time_s if record.command_time_s is None else record.command_time_s
    drive = Drive.of_rows(record.time_s - start, record.voltage_V, command - start, linear)
    return Observations(drive, record.displacement_um, usable, held_out_rows(len(record)))


def only_one_sine(observations: Sequence[Observations]) -> bool:
    """Return whether all that was commanded is one frequency at one amplitude: it tells no memories apart."""
    return all(one_sine(x.time_s, x.command_V) for x in observations)
