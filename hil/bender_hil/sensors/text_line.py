"""A line of text with a number in it, from a serial port or TCP.

Controllers of capacitive, confocal and laser sensors, a load cell's amplifier, an Arduino: whatever speaks one line at
a time, by itself or when it is asked.
"""

import re
import time
from dataclasses import dataclass

from bender_hil.sensors.pace import Pace
from bender_hil.sensors.sensor import Reading
from bender_hil.supply.failures import BadReplyError, NoReplyError, WrongInstrumentError
from bender_hil.supply.link import LinkSettings, VisaLink
from bender_hil.supply.parse import Identity
from bender_loop.bounds import check_numbers

NUMBER = r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
_MOST_SKIPPED = 1000
_BITS_PER_BYTE = 10


@dataclass(frozen=True, slots=True)
class TextLineSettings:
    """The keys of `[sensor]` with `kind = "text"`.

    Attributes:
        resource: VISA address: `ASRL/dev/ttyACM0::INSTR`, `TCPIP::192.168.1.9::24685::SOCKET`.
        unit: of the number: um, nm, mm, m, or any other word with a calibration.
        pattern: regular expression whose first group is the number; the first number of the line where it is not given.
        question: what asks for a line; "" where lines come by themselves.
        prepare: lines that are sent once after opening.
        identify: asks who is there; "" where it cannot say.
        expected: what the answer to `identify` has to hold.
        lost: a line that holds this says that the sensor could not tell, such as "ERROR"; "" for none.
        write_end, read_end: what ends a line.
        timeout_s: how long to wait for an answer.
        baud: of a serial line.
        backend: of PyVISA, "py" or "ivi".
    """

    resource: str
    unit: str = "um"
    pattern: str = NUMBER
    question: str = ""
    prepare: tuple[str, ...] = ()
    identify: str = ""
    expected: str = ""
    lost: str = ""
    write_end: str = "\r\n"
    read_end: str = "\n"
    timeout_s: float = 0.25
    baud: int = 115200
    backend: str = "py"

    def __post_init__(self) -> None:
        object.__setattr__(self, "prepare", tuple(self.prepare))
        check_numbers(self, {"timeout_s": (0.01, 10.0), "baud": (300, 10_000_000)}, whole=("baud",))
        try:
            groups = re.compile(self.pattern).groups
        except re.error as error:
            raise ValueError(f"pattern: found {self.pattern!r}, which is no regular expression ({error})") from None
        if groups < 1:
            raise ValueError(f"pattern: found {self.pattern!r}, expected a group in parentheses around the number")
        if not self.read_end:
            raise ValueError("read_end: found nothing, expected what ends a line")

    def make(self, rate_Hz: float) -> "TextLine":
        """Return the sensor."""
        link = VisaLink(
            LinkSettings(
                self.resource, self.write_end, self.read_end, self.timeout_s, baud=self.baud, backend=self.backend
            )
        )
        return TextLine(link, self, rate_Hz)


class TextLine:
    """Lines behind the `Sensor` protocol.

    Args:
        link: to the instrument, not open yet.
        settings: what a line looks like.
        rate_Hz: so often it is asked, where it has to be.
    """

    cannot = ()

    def __init__(self, link: VisaLink, settings: TextLineSettings, rate_Hz: float) -> None:
        self._link, self._settings = link, settings
        self._pattern = re.compile(settings.pattern)
        self._pace = Pace(rate_Hz)
        is_serial = settings.resource.upper().startswith("ASRL")
        self._byte_s = _BITS_PER_BYTE / settings.baud if is_serial else 0.0
        self._is_cut = False
        self.unit = settings.unit

    def open(self) -> Identity:
        """Open the link, send what prepares it, ask who is there."""
        settings = self._settings
        self._link.open()
        self._link.drain()
        for line in settings.prepare:
            self._link.write(line)
        name = ""
        if settings.identify:
            name = self._link.query(settings.identify).strip()
            if settings.expected not in name:
                raise WrongInstrumentError(f"{name!r:.60} answers there, expected {settings.expected!r} in it")
        # the first line may have begun before the link was there
        self._is_cut = not settings.question
        return Identity("text line", settings.resource, name, "")

    def read(self, timeout_s: float) -> Reading | None:
        """Return the number of the newest line that has come, or of the answer to the question."""
        settings = self._settings
        if settings.question:
            if not self._pace.wait(timeout_s):
                return None
            asked_s = time.perf_counter()
            line = self._link.query(settings.question)
            time_s, passed = 0.5 * (asked_s + time.perf_counter()), 0
        else:
            found = self._newest()
            if found is None:
                return None
            time_s = time.perf_counter()
            line, passed = found
        at_s = time_s - self._byte_s * (len(line) + len(settings.read_end))
        return self._reading(line, at_s)._replace(passed=passed)

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def _newest(self) -> tuple[str, int] | None:
        """Return the last of the lines that wait, and how many before it were passed over."""
        try:
            line = self._link.answer("")
            if self._is_cut:
                # a line that lost its beginning may still look like a number
                line = self._link.answer("")
        except NoReplyError:
            self._is_cut = True
            return None
        self._is_cut = False
        passed = 0
        while self._link.has_line() and passed < _MOST_SKIPPED:
            line, passed = self._link.answer(""), passed + 1
        return line, passed

    def _reading(self, line: str, time_s: float) -> Reading:
        if self._settings.lost and self._settings.lost in line:
            return Reading(0.0, time_s, f"it says {line.strip()!r:.40}")
        found = self._pattern.search(line)
        if found is None:
            raise BadReplyError(f"found the line {line.strip()!r:.60}, expected a number by {self._settings.pattern!r}")
        try:
            return Reading(float(found[1]), time_s)
        except ValueError:
            raise BadReplyError(f"found {found[1]!r:.40} in a line, expected a number") from None
