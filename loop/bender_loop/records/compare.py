"""How well a simulation agrees with a measurement, as it stands and after its reading is recalibrated.

The fit is that of system identification (Ljung, System Identification, 2nd ed. 1999, section 16.4). Lost
frames, where the measurement is NaN, are left out of every figure.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_loop.errors import InputError
from bender_loop.records.scale import scale_question

Signal = NDArray[np.float64]
FEWEST_READINGS = 3
"""Gain and offset take two readings; a third is the least that can disagree."""

ROUNDING = 1e-9
STILL_UM = 1e-9
"""A simulation that moves less than this does not move: the rest is rounding."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """Measured minus simulated, in three figures.

    Attributes:
        rms_um: root of the mean square.
        nrmse_percent: the same over the peak-to-peak of the measurement; None where that is zero.
        fit_percent: 100 (1 - |e| / |y - mean y|), 100 when perfect; None for a constant measurement.
    """

    rms_um: float
    nrmse_percent: float | None
    fit_percent: float | None


@dataclass(frozen=True, slots=True)
class Recalibration:
    """The straight line from the simulated to the measured reading: gain * simulated + offset_um."""

    gain: float
    offset_um: float

    def apply(self, simulated_um: Signal) -> Signal:
        """The recalibrated simulation, shape as given."""
        return self.gain * simulated_um + self.offset_um

    def offset_told_um(self, beside_um: float) -> float:
        """Return the offset, 0 where it is nothing but rounding beside another length."""
        return self.offset_um if abs(self.offset_um) > ROUNDING * abs(beside_um) else 0.0


@dataclass(frozen=True, slots=True)
class Comparison:
    """One simulation beside one measurement.

    Attributes:
        rows: length of the record.
        lost_rows: rows without a reading.
        before: agreement of the simulation as it is.
        recalibration: least-squares gain and offset.
        recalibrated: agreement once they are applied.
    """

    rows: int
    lost_rows: int
    before: Agreement
    recalibration: Recalibration
    recalibrated: Agreement

    @property
    def question(self) -> str | None:
        """What to ask where the readings move tenfold or more than the simulation, or as much less."""
        asked = scale_question(self.recalibration.gain) if self.recalibrated.rms_um < self.before.rms_um else None
        return f"the readings move {asked}" if asked else None


def compare(measured_um: Signal, simulated_um: Signal) -> Comparison:
    """Compare two readings of equal shape (n,); NaN in the measurement marks a lost frame.

    Raises:
        InputError: fewer than three readings are left.
        ValueError: the shapes differ.
    """
    if measured_um.shape != simulated_um.shape:
        raise ValueError(f"shapes differ: measured {measured_um.shape}, simulated {simulated_um.shape}")
    require_readings(measured_um)
    seen = np.isfinite(measured_um)
    measured, simulated = measured_um[seen], simulated_um[seen]
    line = recalibrate(measured, simulated)
    return Comparison(
        rows=measured_um.size,
        lost_rows=int(measured_um.size - measured.size),
        before=agreement(measured, simulated),
        recalibration=line,
        recalibrated=agreement(measured, line.apply(simulated)),
    )


def require_readings(measured_um: Signal) -> None:
    """Raise InputError where fewer than `FEWEST_READINGS` of the rows have a reading."""
    seen = int(np.isfinite(measured_um).sum())
    if seen < FEWEST_READINGS:
        raise InputError(
            f"displacement_um: {seen} readings in {measured_um.size} rows, expected at least {FEWEST_READINGS}; "
            "give a longer record"
        )


def agreement(measured_um: Signal, simulated_um: Signal) -> Agreement:
    """The three figures of two finite readings of shape (n,), n > 0."""
    rms_um = _rms(measured_um - simulated_um)
    span_um = float(np.ptp(measured_um))
    spread_um = _rms(measured_um - measured_um.mean())
    if spread_um == 0.0:  # also of readings so small that their squares vanish
        return Agreement(rms_um, None, None)
    return Agreement(rms_um, 100.0 * rms_um / span_um, 100.0 * (1.0 - rms_um / spread_um))


def recalibrate(measured_um: Signal, simulated_um: Signal) -> Recalibration:
    """Least-squares gain and offset from simulated to measured reading, both finite and of shape (n,).

    A simulation that never moves says nothing about the gain, which then stays 1.
    """
    mean_um = simulated_um.mean()
    moved = simulated_um - mean_um
    is_still = np.ptp(simulated_um) < STILL_UM
    gain = 1.0 if is_still else float(moved @ measured_um) / float(moved @ moved)
    return Recalibration(gain, float(measured_um.mean() - gain * mean_um))


def _rms(error_um: Signal) -> float:
    return math.sqrt(float(np.mean(np.square(error_um))))
