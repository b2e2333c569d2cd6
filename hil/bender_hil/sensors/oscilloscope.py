"""An oscilloscope, or a Red Pitaya, by SCPI: each reading is the mean of one record that is triggered at once."""

import time
from dataclasses import dataclass

from bender_hil.sensors.pace import Pace
from bender_hil.sensors.scope_dialect import OVERLOAD, SCOPES, ScopeDialect, numbers
from bender_hil.sensors.sensor import Reading
from bender_hil.sensors.triggered import check_pace, identified
from bender_hil.supply import parse
from bender_hil.supply.failures import BadReplyError, ComplaintError, NoReplyError
from bender_hil.supply.link import Link, LinkSettings, VisaLink
from bender_hil.supply.parse import Identity
from bender_loop.bounds import check_numbers
from bender_loop.shell.plugins import A_CLASS_OF_YOURS

_NEAR_THE_END = 0.99
"""Of the range: samples beyond it may have been cut off."""
_POLL_S = 1e-3


@dataclass(frozen=True, slots=True)
class OscilloscopeSettings:
    """The keys of `[sensor]` with `kind = "oscilloscope"`.

    Attributes:
        resource: VISA address.
        model: a key of `SCOPES`.
        channel: of the input.
        range_V: largest voltage that is to be measured, either way; with a Red Pitaya 1 or 20, as its jumper is set.
        aperture_s: how long a record is, whose mean is the reading.
        serial: its serial number; None for any.
        timeout_s: how long to wait for a record, beyond its length.
        backend: of PyVISA, "py" or "ivi".
    """

    resource: str
    model: str = "RedPitaya"
    channel: int = 1
    range_V: float = 20.0
    aperture_s: float = 0.01
    serial: str | None = None
    timeout_s: float = 0.25
    backend: str = "py"

    def __post_init__(self) -> None:
        if self.model not in SCOPES:
            raise ValueError(
                f"model must be one of {', '.join(SCOPES)}, found {self.model!r:.60}; add another oscilloscope as "
                f"{A_CLASS_OF_YOURS}"
            )
        words = SCOPES[self.model]
        bounds = {
            "channel": (1, words.channels), "range_V": (1e-3, 1e3), "aperture_s": (1e-5, words.longest_s),
            "timeout_s": (0.01, 10.0),
        }  # fmt: skip
        check_numbers(self, bounds, whole=("channel",))
        if words.ranges and self.range_V not in words.ranges:
            known = " or ".join(f"{range_V:g}" for range_V in words.ranges)
            raise ValueError(f"range_V: found {self.range_V:g}, expected {known}, as the jumper of the input is set")

    def make(self, rate_Hz: float) -> "Oscilloscope":
        """Return the oscilloscope; ValueError where a record takes longer than the time between two."""
        check_pace(self.aperture_s, rate_Hz)
        words = SCOPES[self.model]
        link = VisaLink(
            LinkSettings(self.resource, words.write_end, words.read_end, self.timeout_s, backend=self.backend)
        )
        return Oscilloscope(link, words, self, rate_Hz)


class Oscilloscope:
    """An oscilloscope behind the `Sensor` protocol.

    Args:
        link: to the instrument, not open yet.
        dialect: its words.
        settings: channel, range, length of a record, serial number.
        rate_Hz: so often it is triggered.
    """

    unit = "V"
    cannot = ()

    def __init__(self, link: Link, dialect: ScopeDialect, settings: OscilloscopeSettings, rate_Hz: float) -> None:
        self._link, self._dialect, self._settings = link, dialect, settings
        self._pace = Pace(rate_Hz)
        self._words = {
            "channel": str(settings.channel),
            "range": dialect.ranges.get(settings.range_V, f"{2.0 * settings.range_V:g}"),
            "aperture_s": f"{settings.aperture_s:g}",
            **numbers(settings.aperture_s),
        }

    def open(self) -> Identity:
        """Open the link, identify, set up; what it complains about is an error."""
        self._link.open()
        self._link.drain()
        identity = self._identity()
        for command in self._dialect.prepare:
            self._link.write(command.format(**self._words))
        question = self._dialect.errors
        complaint = parse.complaint(question, self._link.query(question))
        if complaint is not None:
            raise ComplaintError(f"the oscilloscope complains about its settings: {complaint}")
        return identity

    def read(self, timeout_s: float) -> Reading | None:
        """Trigger when it is due, wait for the record; the time of its mean is the middle of the record."""
        if not self._pace.wait(timeout_s):
            return None
        triggered_s = 0.0
        for command in self._dialect.trigger:
            triggered_s = self._link.write(command)
        self._wait_until_done(triggered_s)
        question = self._dialect.read.format(**self._words)
        samples = _samples(question, self._link.query(question))
        most_V = max(map(abs, samples))
        is_cut = most_V > OVERLOAD or most_V >= _NEAR_THE_END * self._settings.range_V
        lost = f"overload: at the ends of its range of {self._settings.range_V:g} V" if is_cut else None
        middle_s = triggered_s + (0.5 - self._dialect.begins) * self._settings.aperture_s
        return Reading(sum(samples) / len(samples), middle_s, lost)

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def _wait_until_done(self, triggered_s: float) -> None:
        """Ask until the record is there, at first when it can be."""
        words, settings = self._dialect, self._settings
        end_s = triggered_s + settings.aperture_s + settings.timeout_s
        wait_s = settings.aperture_s * (1.0 - words.begins)
        while True:
            time.sleep(max(0.0, min(triggered_s + wait_s, end_s) - time.perf_counter()))
            state = int(parse.number(words.state, self._link.query(words.state)))
            if state & words.state_mask == words.state_done:
                return
            wait_s = time.perf_counter() - triggered_s + _POLL_S
            if time.perf_counter() > end_s:
                raise NoReplyError(f"{settings.resource}: no record within {end_s - triggered_s:.3g} s of its trigger")

    def _identity(self) -> Identity:
        words = self._dialect
        return identified(
            self._link, words.name, words.makers, self._settings.serial, lambda model: model.startswith(words.models)
        )


def _samples(question: str, answer: str) -> list[float]:
    """Return one number, or those between braces; BadReplyError for anything else."""
    parts = answer.strip().removeprefix("{").removesuffix("}").split(",")
    if (answer.strip()[:1] == "{") != (answer.strip()[-1:] == "}"):
        raise BadReplyError(f"{question} was answered with {answer[:40]!r}, expected samples between braces")
    return [parse.number(question, part) for part in parts]
