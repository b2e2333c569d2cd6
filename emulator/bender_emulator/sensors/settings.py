"""What an emulated sensor is told."""

from dataclasses import dataclass

from bender_loop.bounds import FROM_0, check_numbers

TEXT, DAQ = "text", "daq"
METERS = ("DMM6500", "34465A")
SCOPES = ("RedPitaya", "DSOX")
KINDS = (*METERS, *SCOPES, TEXT, DAQ)


@dataclass(frozen=True, slots=True)
class SensorEmulation:
    """The table `[emulator.sensor_settings]`, with the kind of the sensor.

    Attributes:
        kind: a multimeter or an oscilloscope behind a capacitive sensor or a strain bridge; "text": a controller that
            sends lines; "daq": an analogue input.
        rate_Hz: readings per second.
        aperture_s: how long a reading averages.
        volts_per_um, offset_V: of what the multimeter or the oscilloscope reads.
        noise_um: standard deviation of a reading.
        range_um: the sensor saturates this far from its middle.
        zero_um: what a text sensor says at rest.

    Raises:
        ValueError: a value is out of its range.
    """

    kind: str
    rate_Hz: float = 30.0
    aperture_s: float = 0.01
    volts_per_um: float = 0.05
    offset_V: float = 1.25
    noise_um: float = 0.02
    range_um: float = 150.0
    zero_um: float = 500.0

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"sensor must be one of {', '.join(KINDS)}, found {self.kind!r}")
        bounds = {
            "rate_Hz": (0.5, 5000.0), "aperture_s": (1e-5, 0.5), "volts_per_um": (1e-6, 10.0),
            "offset_V": (-10.0, 10.0), "noise_um": FROM_0, "range_um": (1e-3, 1e5), "zero_um": (-1e5, 1e5),
        }  # fmt: skip
        check_numbers(self, bounds)
