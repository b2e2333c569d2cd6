"""What is played to a bench: when rows are read, what is commanded, when the command acts."""

from dataclasses import dataclass

import numpy as np
from bender_proving.chain import Commands
from bender_proving.cases.hidden import Sensor, Setting
from bender_proving.physics.lobatto import Array
from bender_proving.cases.nominal import FULL_VOLTAGE_V
from numpy.random import Generator
from numpy.typing import ArrayLike

RATE_HZ: dict[Sensor, float] = {"camera": 30.0, "vibrometer": 4000.0}
_RUNNER_S: dict[Sensor, tuple[float, float]] = {"camera": (0.5e-3, 6e-3), "vibrometer": (20e-6, 80e-6)}
_JITTER = 0.12
_SKIPPED = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """Rows of a record before anything is read, columns of shape (n,).

    Attributes:
        sensor: whose rows these are.
        time_s: when the rows are read; rows before 0 are played but not recorded.
        voltage_V: what is commanded, 0 to 50 V.
        command_time_s: when it acts; None for time_s.
    """

    sensor: Sensor
    time_s: Array
    voltage_V: Array
    command_time_s: Array | None = None

    def __post_init__(self) -> None:
        if self.time_s.shape != self.voltage_V.shape or self.time_s.ndim != 1 or len(self.time_s) < 2:
            raise ValueError(
                f"voltage_V must have the shape of time_s, (n,) with n >= 2, found {self.voltage_V.shape} and "
                f"{self.time_s.shape}"
            )
        low, high = float(np.min(self.voltage_V)), float(np.max(self.voltage_V))
        if not (low >= 0.0 and high <= FULL_VOLTAGE_V):
            raise ValueError(f"voltage_V must lie between 0 and {FULL_VOLTAGE_V:g}, found {low!r} to {high!r}")
        if not np.all(np.diff(self.time_s) > 0.0):
            raise ValueError("time_s must increase strictly")

    @property
    def commands(self) -> Commands:
        """The rows as the bench meets them."""
        acting = self.time_s if self.command_time_s is None else self.command_time_s
        return Commands(self.time_s, acting, self.voltage_V)

    @property
    def recorded(self) -> slice:
        """The rows that enter the record."""
        return slice(int(np.searchsorted(self.time_s, 0.0)), None)

    @property
    def setting(self) -> Setting:
        """What a draw of hidden effects may know of this record."""
        return Setting(self.sensor, RATE_HZ[self.sensor], float(self.time_s[-1]))


def even(sensor: Sensor, voltage_V: Array, lead: int = 0) -> Excitation:
    """Rows at the sensor's rate, the first `lead` of them before time 0."""
    time_s = (np.arange(len(voltage_V)) - lead) / RATE_HZ[sensor]
    return Excitation(sensor, time_s, voltage_V)


def uneven(excitation: Excitation, rng: Generator) -> Excitation:
    """The same rows with a clock that trembles by some percent of a row and now and then skips one."""
    count = len(excitation.time_s)
    steps = 1.0 + rng.uniform(-_JITTER, _JITTER, count) + (rng.random(count) < _SKIPPED)
    time_s = np.round((np.cumsum(steps) - steps[0]) / RATE_HZ[excitation.sensor], 7)
    first = excitation.recorded.start
    return Excitation(excitation.sensor, time_s - time_s[first], excitation.voltage_V)


def with_runner(excitation: Excitation, rng: Generator) -> Excitation:
    """The same rows with every command acting a little after its row was read, by an amount that varies."""
    late_s = rng.uniform(*_RUNNER_S[excitation.sensor], len(excitation.time_s))
    acting_s = np.round(excitation.time_s + late_s, 7)
    return Excitation(excitation.sensor, excitation.time_s, excitation.voltage_V, acting_s)


def played(sensor: Sensor, time_s: ArrayLike, voltage_V: ArrayLike) -> Excitation:
    """A given voltage profile, each value held from its time to the next, met by the rows of `sensor`.

    The profile's first value acts at its time, taken as 0; its last one is held as long as the one before it (for at
    least one row).

    Raises:
        ValueError: times do not increase strictly, lengths differ, or a voltage is outside 0 to 50 V.
    """
    times, volts = np.asarray(time_s, dtype=np.float64), np.asarray(voltage_V, dtype=np.float64)
    if times.ndim != 1 or times.shape != volts.shape or len(times) < 2 or not np.all(np.diff(times) > 0.0):
        raise ValueError(
            f"time_s must increase strictly with one voltage each, found shapes {times.shape}, {volts.shape}"
        )
    times = times - times[0]
    rate_Hz = RATE_HZ[sensor]
    rows = np.arange(max(2, round((2.0 * times[-1] - times[-2]) * rate_Hz) + 1)) / rate_Hz
    latest = np.searchsorted(times, rows + 1e-9, side="right") - 1
    return Excitation(sensor, rows, volts[latest])
