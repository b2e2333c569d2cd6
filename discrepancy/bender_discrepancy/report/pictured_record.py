"""What the pictures of a report show: one record with its readings, before and after, and the residual."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.acting_voltage import direction

if TYPE_CHECKING:  # the process that draws charts has no use for what a search needs
    from bender_discrepancy.conclusion.findings import Findings
    from bender_discrepancy.conclusion.measurement.gap import Measured

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# rows of the stretch that is shown row by row
STRETCH_ROWS = 260
COMMON = 0.98
# a step of time this many times the usual one is a pause of the record
PAUSE = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class PicturedRecord:
    """One record, arrays of shape (n,).

    Attributes:
        name: of the record.
        axis: time in s, or the row of an untimed record.
        axis_label: its name with the unit.
        acting_V: the voltage that was acting when a row was read.
        rising: whether its last change was upwards.
        measured_um: with NaN where a reading did not count.
        given_um: the model as given.
        recalibrated_um: after calibration alone.
        after_um: the corrected FMU.
        held_out: the rows that are reported on: neither a fit nor a choice saw them.
        noise_um: noise floor.
        corrected: the corrected model differs from the recalibrated one.
    """

    name: str
    axis: Array
    axis_label: str
    acting_V: Array
    rising: Mask
    measured_um: Array
    given_um: Array
    recalibrated_um: Array
    after_um: Array
    held_out: Mask
    noise_um: float
    corrected: bool

    @property
    def without_um(self) -> Array:
        """What the recalibrated model leaves."""
        return self.measured_um - self.recalibrated_um

    @property
    def with_um(self) -> Array:
        """What the corrected FMU leaves."""
        return self.measured_um - self.after_um

    @property
    def is_short(self) -> bool:
        """Whether all of it can be shown row by row."""
        return self.axis.size <= STRETCH_ROWS

    @property
    def stretch(self) -> slice:
        """The held-out rows, in one piece, on which the recalibrated model is furthest off; all of a short record."""
        if self.is_short:
            return slice(0, self.axis.size)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], self.held_out, [False]]).astype(int)))
        pauses = np.flatnonzero(np.diff(self.axis) > PAUSE * np.median(np.diff(self.axis))) + 1
        # a pause ends one piece and begins another
        inside = pauses[self.held_out[pauses] & self.held_out[pauses - 1]]
        edges = np.sort(np.concatenate([edges, inside, inside]))
        square = np.nan_to_num(self.without_um**2)
        # a few stray readings do not make a stretch worth showing
        square = np.minimum(square, np.quantile(square, COMMON))
        pieces = [
            slice(begin, min(begin + STRETCH_ROWS, end))
            for first, end in zip(edges[::2], edges[1::2], strict=True)
            for begin in range(first, end, STRETCH_ROWS)
        ]
        return max(pieces, key=lambda piece: float(square[piece].sum()), default=slice(0, self.axis.size))


def pictured_record(findings: "Findings", measured: "Measured", record: int, name: str) -> PicturedRecord:
    """Return one record of a diagnosis as the pictures show it."""
    x = findings.search.problem.observations[record]
    untimed = findings.search.settings.untimed
    volts = x.acting_V
    return PicturedRecord(
        name=name,
        axis=np.arange(x.time_s.size, dtype=np.float64) if untimed else x.time_s,
        axis_label="row" if untimed else "time (s)",
        acting_V=volts,
        rising=direction(volts) > 0.0,
        measured_um=np.where(x.usable, x.measured_um, np.nan),
        given_um=measured.before_um[record],
        recalibrated_um=measured.recalibrated_um[record],
        after_um=measured.after_um[record],
        held_out=x.reported,
        noise_um=measured.floor_um,
        corrected=findings.is_corrected,
    )
