"""A bench multimeter by SCPI: it is triggered, averages over its aperture and gives one voltage."""

import time
from dataclasses import dataclass

from bender_hil.sensors.meter_dialect import METERS, OVERLOAD, MeterDialect
from bender_hil.sensors.pace import Pace
from bender_hil.sensors.sensor import Reading
from bender_hil.sensors.triggered import check_pace, identified
from bender_hil.supply import parse
from bender_hil.supply.failures import ComplaintError, MismatchError
from bender_hil.supply.link import Link, LinkSettings, VisaLink
from bender_hil.supply.parse import Identity
from bender_loop.bounds import check_numbers
from bender_loop.shell.plugins import A_CLASS_OF_YOURS

_APERTURE_PART = 0.02
"""By which the aperture that was read back may differ: instruments round it to what they can do."""


@dataclass(frozen=True, slots=True)
class MultimeterSettings:
    """The keys of `[sensor]` with `kind = "multimeter"`.

    Attributes:
        resource: VISA address.
        model: a key of `METERS`.
        range_V: largest voltage that is to be measured; a fixed range, as an automatic one takes its time.
        aperture_s: how long a reading averages; a multiple of the mains period keeps its hum out.
        serial: its serial number; None for any.
        timeout_s: how long to wait for a reading, beyond its aperture.
        baud: of a serial line.
        backend: of PyVISA, "py" or "ivi".
    """

    resource: str
    model: str = "DMM6500"
    range_V: float = 10.0
    aperture_s: float = 0.01
    serial: str | None = None
    timeout_s: float = 0.25
    baud: int = 9600
    backend: str = "py"

    def __post_init__(self) -> None:
        if self.model not in METERS:
            raise ValueError(
                f"model must be one of {', '.join(METERS)}, found {self.model!r:.60}; add another multimeter as "
                f"{A_CLASS_OF_YOURS}"
            )
        bounds = {
            "range_V": (1e-3, 1e3), "aperture_s": (1e-5, 1.0), "timeout_s": (0.01, 10.0), "baud": (300, 10_000_000),
        }  # fmt: skip
        check_numbers(self, bounds, whole=("baud",))

    def make(self, rate_Hz: float) -> "Multimeter":
        """Return the multimeter; ValueError where a reading takes longer than the time between two."""
        check_pace(self.aperture_s, rate_Hz)
        words = METERS[self.model]
        timeout_s = self.timeout_s + self.aperture_s
        link = VisaLink(
            LinkSettings(
                self.resource, words.write_end, words.read_end, timeout_s, baud=self.baud, backend=self.backend
            )
        )
        return Multimeter(link, words, self, rate_Hz)


class Multimeter:
    """A multimeter behind the `Sensor` protocol.

    Args:
        link: to the instrument, not open yet.
        dialect: its words.
        settings: range, aperture, serial number.
        rate_Hz: so often it is triggered.
    """

    unit = "V"
    cannot = ()

    def __init__(self, link: Link, dialect: MeterDialect, settings: MultimeterSettings, rate_Hz: float) -> None:
        self._link, self._dialect, self._settings = link, dialect, settings
        self._pace = Pace(rate_Hz)

    def open(self) -> Identity:
        """Open the link, identify, set up, read the aperture back."""
        self._link.open()
        # a serial line may still owe an answer to whoever was here before
        self._link.drain()
        identity = self._identity()
        numbers = {"range_V": f"{self._settings.range_V:g}", "aperture_s": f"{self._settings.aperture_s:g}"}
        for command in self._dialect.prepare:
            self._link.write(command.format(**numbers))
        question = self._dialect.errors
        complaint = parse.complaint(question, self._link.query(question))
        if complaint is not None:
            raise ComplaintError(f"the multimeter complains about its settings: {complaint}")
        question, wanted_s = self._dialect.aperture_setting, self._settings.aperture_s
        aperture_s = parse.number(question, self._link.query(question))
        if abs(aperture_s - wanted_s) > _APERTURE_PART * wanted_s:
            raise MismatchError(f"an aperture of {wanted_s:g} s was set, {question} says {aperture_s:g} s")
        return identity

    def read(self, timeout_s: float) -> Reading | None:
        """Trigger when it is due, and wait for the reading; its time is the middle of the aperture."""
        if not self._pace.wait(timeout_s):
            return None
        asked_s = time.perf_counter()
        value = parse.number(self._dialect.read, self._link.query(self._dialect.read))
        lost = f"overload: more than the range of {self._settings.range_V:g} V" if abs(value) > OVERLOAD else None
        return Reading(value, asked_s + 0.5 * self._settings.aperture_s, lost)

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def _identity(self) -> Identity:
        words = self._dialect
        return identified(
            self._link,
            words.name,
            words.makers,
            self._settings.serial,
            lambda model: any(x in model for x in words.models),
        )
