"""What a sensor is. Another package's is written against this file alone (docs/how-to/write-a-source-or-sensor.md)."""

from typing import NamedTuple, Protocol

from bender_hil.supply.parse import Identity

LENGTHS_UM = {"um": 1.0, "µm": 1.0, "nm": 1e-3, "mm": 1e3, "m": 1e6}
"""Units of a sensor that needs no calibration: how many micrometres each is."""


class Reading(NamedTuple):
    """One reading.

    Attributes:
        value: in the sensor's unit; whatever it is where `lost` says why it is none.
        time_s: `time.perf_counter` at which it holds: the middle of what was averaged.
        lost: why the sensor could not tell, None where it could.
        passed: readings before it that waited and were passed over.
    """

    value: float
    time_s: float
    lost: str | None = None
    passed: int = 0


class Sensor(Protocol):
    """An instrument that says where the tip is.

    One thread calls it. It may raise whatever goes wrong: it is then closed and opened anew, while the runner counts
    the time without a reading and ends the run when that is too long.
    """

    @property
    def unit(self) -> str:
        """Unit of the values: one of `LENGTHS_UM`, or any other, which needs a calibration."""
        ...

    @property
    def cannot(self) -> tuple[str, ...]:
        """What it cannot do and somebody might expect, a sentence each."""
        ...

    def open(self) -> Identity:
        """Open the link, make sure that the right instrument is there, set it up."""
        ...

    def read(self, timeout_s: float) -> Reading | None:
        """Return the next reading, None when there was none within `timeout_s`."""
        ...

    def close(self) -> None:
        """Close the link; never raises."""
        ...


class SensorSettings(Protocol):
    """Settings of a kind of sensor: a frozen dataclass whose fields are the keys under `[sensor]`."""

    def make(self, rate_Hz: float) -> Sensor:
        """Return the sensor, not open yet; one that has to be asked is asked `rate_Hz` times a second."""
        ...
