"""What the table `[sensor]` says beside the instrument: how often, how late, in which unit, where it is valid."""

from collections.abc import Callable
from dataclasses import dataclass

from bender_hil.calibration.sensor_scale import SensorCalibration
from bender_hil.sensors.sensor import LENGTHS_UM, Sensor, SensorSettings
from bender_loop.bounds import check_numbers
from bender_loop.shell.plugins import check_complete

COMMON = ("rate_Hz", "delay_s", "exposure_s", "calibration", "valid", "zero_readings", "repeats_count")
"""Keys of `[sensor]` that are not the instrument's own."""

ToUm = Callable[[float], float]


@dataclass(frozen=True, slots=True)
class SensorTable:
    """A sensor and what is made of its readings.

    Attributes:
        kind: of the sensor.
        instrument: its settings.
        rate_Hz: readings per second, which is the rate of the loop.
        delay_s: age of a reading when it has its time, beyond what the sensor takes off itself.
        exposure_s: how long a reading averages; None for the instrument's own `aperture_s`, or for all the time between
            two where it says so.
        calibration: file of `bender calibrate --sensor`; None for a sensor that gives a length.
        valid: readings outside, in the sensor's unit, are none; None for all that the calibration covers.
        zero_readings: so many readings at 0 V make the rest position.
        repeats_count: whether readings may repeat themselves for ever; for a sensor without any noise.
    """

    kind: str
    instrument: SensorSettings
    rate_Hz: float = 30.0
    delay_s: float = 0.0
    exposure_s: float | None = None
    calibration: str | None = None
    valid: tuple[float, float] | None = None
    zero_readings: int = 15
    repeats_count: bool = False

    def __post_init__(self) -> None:
        bounds = {
            "rate_Hz": (0.5, 20_000.0), "delay_s": (0.0, 1.0), "exposure_s": (0.0, 1.0), "zero_readings": (3, 10_000),
        }  # fmt: skip
        check_numbers(self, bounds, whole=("zero_readings",))
        if self.valid is not None:
            object.__setattr__(self, "valid", tuple(self.valid))
            if len(self.valid) != 2 or not self.valid[0] < self.valid[1]:
                raise ValueError(f"valid: found {list(self.valid)!r}, expected two numbers in order")
        # what the instrument cannot do at this rate shows before anything is opened
        check_complete(self.instrument.make(self.rate_Hz), Sensor)

    @property
    def averaged_s(self) -> float | None:
        """How long a reading averages, as far as the file says it."""
        if self.exposure_s is not None:
            return self.exposure_s
        between = getattr(self.instrument, "averages_between_readings", False)
        return 1.0 / self.rate_Hz if between else getattr(self.instrument, "aperture_s", None)


def conversion(unit: str, calibration: SensorCalibration | None) -> ToUm:
    """Return what turns a value into micrometres.

    Raises:
        ValueError: the unit is no length and there is no calibration, or the calibration is for another unit.
    """
    if calibration is None:
        if unit not in LENGTHS_UM:
            raise ValueError(
                f"the sensor gives {unit}, which is no length: make a calibration with `bender calibrate --sensor` and "
                "name it as `calibration` under [sensor]"
            )
        factor = LENGTHS_UM[unit]
        return lambda value: factor * value
    if calibration.unit != unit:
        raise ValueError(f"the sensor gives {unit}, its calibration is for {calibration.unit}")
    return calibration.to_um
