"""What an emulated sensor is told, and what a bench file would say of it."""

from dataclasses import dataclass

from bender_hil.bounds import FROM_0, check_numbers
from bender_hil.calibration.sensor_scale import SensorCalibration, fit_sensor
from bender_hil.emulator.sources import daq_stand_in
from bender_hil.emulator.sources.daq_stand_in import OFFSET_V, VOLTS_PER_UM
from bender_hil.sensors.daq_input import DaqInputSettings
from bender_hil.sensors.meter_dialect import METERS
from bender_hil.sensors.multimeter import MultimeterSettings
from bender_hil.sensors.table import SensorTable
from bender_hil.sensors.text_line import TextLineSettings

TEXT, DAQ = "text", "daq"
KINDS = (*METERS, TEXT, DAQ)
_NOWHERE = "TCPIP::127.0.0.1::9::SOCKET"
"""Stands for an address that is known once the emulated sensor runs."""


@dataclass(frozen=True, slots=True)
class SensorEmulation:
    """The table `[emulator.sensor_settings]`, with the kind of the sensor.

    Attributes:
        kind: a multimeter behind a capacitive sensor or a strain bridge, or "text": a controller that sends
            lines; "daq": an analogue input.
        rate_Hz: readings per second.
        aperture_s: how long a reading averages.
        volts_per_um, offset_V: of what the multimeter reads.
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

    def calibration(self) -> SensorCalibration | None:
        """What its volts are worth, as a perfect calibration would say; None for a sensor that gives micrometres."""
        if self.kind == TEXT:
            return None
        per_um, offset_V = (VOLTS_PER_UM, OFFSET_V) if self.kind == DAQ else (self.volts_per_um, self.offset_V)
        ends_um = (-self.range_um, self.range_um)
        volts = [offset_V + per_um * end_um for end_um in ends_um]
        return fit_sensor(volts, ends_um, "V", source="the emulated sensor's own settings")

    def table(self, resource: str) -> SensorTable:
        """What `[sensor]` of a bench file would say; without an address for one that does not run yet."""
        place = resource or _NOWHERE
        kind, instrument, exposure_s = "multimeter", None, None
        if self.kind == TEXT:
            kind, instrument, exposure_s = "text", TextLineSettings(place), self.aperture_s
        elif self.kind == DAQ:
            kind, exposure_s = "daq", 1.0 / self.rate_Hz
            instrument = DaqInputSettings(place, backend=daq_stand_in.__name__)
        return SensorTable(
            kind,
            instrument or MultimeterSettings(place, self.kind, aperture_s=self.aperture_s),
            self.rate_Hz,
            exposure_s=exposure_s,
            repeats_count=self.noise_um == 0.0,
        )
