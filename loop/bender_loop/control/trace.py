"""What a closed-loop run leaves behind."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """A run at its ticks 0 … n, all arrays (n+1,). Row k was read before the command of row k acts.

    Attributes:
        time_s: k times the period.
        setpoint_um: the reference at the ticks.
        measured_um: what the controller saw at the tick: late, blurred, noisy, quantised.
        displacement_um: the plant's true output at the tick.
        voltage_V: the command, held until the next tick.
        diverged: the run was ended early because the displacement went past all bounds or was no number; the
            arrays end with the last sound frame.
        fine_time_s: the ends of all plant steps, (n * substeps + 1,); None with one step per period.
        fine_displacement_um: the true output there, or None.
    """

    time_s: Array
    setpoint_um: Array
    measured_um: Array
    displacement_um: Array
    voltage_V: Array
    diverged: bool = False
    fine_time_s: Array | None = None
    fine_displacement_um: Array | None = None

    def to_record(self) -> Record:
        """The run as a record whose displacement is what the controller saw.

        Raises:
            ValueError: the run diverged in its first period.
        """
        return Record(self.time_s, self.voltage_V, self.measured_um, setpoint_um=self.setpoint_um)
