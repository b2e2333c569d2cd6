"""The driver of function generators and piezo controllers: words from a dialect, answers matched strictly."""

import math
import re
import time
from dataclasses import dataclass

from bender_hil.sources.line_dialect import LINE_DIALECTS, LineDialect
from bender_hil.supply.failures import (
    BadReplyError,
    ComplaintError,
    MismatchError,
    SupplyError,
    WrongInstrumentError,
)
from bender_hil.supply.link import LineLink, LinkSettings, VisaLink
from bender_hil.supply.parse import Identity
from bender_hil.supply.patience import Patience
from bender_hil.supply.same_instrument import SameInstrument
from bender_hil.supply.source import Bounds
from bender_loop.bounds import check_numbers
from bender_loop.shell.plugins import A_CLASS_OF_YOURS

_TRIALS = 3
_GAP_S = 0.01
_FALL_S = 1.0


@dataclass(frozen=True, slots=True)
class LineSettings:
    """The keys of `[source]` with `kind = "generator"` or `kind = "piezo_controller"`.

    Attributes:
        resource: VISA address.
        model: a key of `LINE_DIALECTS`.
        axis: its channel, where it has several: "x", "y", "z" of a Thorlabs MDT693B; "1" or "A" of a PI controller.
        serial: its serial number; None for any.
        timeout_s: how long to wait for an answer.
        baud: of a serial line; None for what it is delivered with.
        spacing_s: shortest time between two commands.
        backend: of PyVISA, "py" or "ivi".
    """

    resource: str
    model: str
    axis: str | None = None
    serial: str | None = None
    timeout_s: float = 0.25
    baud: int | None = None
    spacing_s: float = 0.0
    backend: str = "py"

    def __post_init__(self) -> None:
        if self.model not in LINE_DIALECTS:
            raise ValueError(
                f"model must be one of {', '.join(LINE_DIALECTS)}, found {self.model!r:.60}; add another generator or "
                f"controller as {A_CLASS_OF_YOURS}"
            )
        if self.axis is not None and re.fullmatch(r"\w{1,8}", self.axis, re.ASCII) is None:
            raise ValueError(f"axis: found {self.axis!r}, expected a letter or a number")
        bounds = {"timeout_s": (0.01, 10.0), "baud": (300, 10_000_000), "spacing_s": (0.0, 1.0)}
        check_numbers(self, bounds, whole=("baud",))

    def make(self, identity: Identity | None = None) -> "LineSource":
        """Return the instrument, not open yet; with an identity, only the one that said this of itself will do."""
        words = LINE_DIALECTS[self.model]
        link = VisaLink(
            LinkSettings(
                self.resource,
                words.write_end,
                words.read_end,
                self.timeout_s,
                self.baud or words.baud,
                self.spacing_s,
                self.backend,
            )
        )
        return LineSource(link, words, axis=self.axis, serial=self.serial, identity=identity)


class LineSource:
    """A generator or controller behind the `Source` protocol.

    Args:
        link: to the instrument, not open yet.
        dialect: its words.
        axis: its channel; None for the dialect's.
        serial: serial number that it must have, None for any.
        identity: what it said of itself on an earlier link, None where there was none.
    """

    def __init__(
        self,
        link: LineLink,
        dialect: LineDialect,
        *,
        axis: str | None = None,
        serial: str | None = None,
        identity: Identity | None = None,
    ) -> None:
        self._link, self._dialect, self._serial = link, dialect, serial
        self._axis = dialect.axis if axis is None else axis
        self._same = SameInstrument(identity)
        self._told_V = 0.0

    @property
    def patience(self) -> Patience:
        """The deadline of every wait."""
        return self._link.patience

    @property
    def setting_tolerance_V(self) -> float:
        """Half a step: a level is read back as it was sent."""
        return 10.0**-self._dialect.decimals

    def open(self) -> Identity:
        """Open the link and identify the instrument; nothing is set before it is the right one."""
        self._link.open()
        return self._identify()

    def arm(self, bounds: Bounds) -> list[str]:
        """Output off, 0 V, read back, output on; returns what such an instrument cannot do.

        Raises:
            ValueError: the instrument cannot do what the bounds ask for.
            SupplyError: a setting was refused or read back differently.
        """
        words = self._dialect
        bounds.check(words.lowest_V, words.highest_V, f"the {words.name}")
        self._check_limit(bounds)
        for command in words.prepare:
            self._tell(command)
        if words.voltage_setting is not None and re.fullmatch(words.armed, self._ask(words.voltage_setting)) is None:
            raise MismatchError(f"the {words.name} was prepared, but does not give a steady voltage")
        most_V, end_s = max(words.off_below_V, self.setting_tolerance_V), time.perf_counter() + _FALL_S
        while abs(level_V := self._level_V()) > most_V:
            # one that measures its output may have been left at a voltage
            if time.perf_counter() > end_s:
                raise MismatchError(f"0 V were set, but {level_V:g} V are read back, expected less than {most_V:g} V")
            self.patience.pause(_GAP_S)
        if words.output_on is not None:
            self._tell(words.output_on)
            if not self.is_on():
                raise MismatchError(f"{words.output_on} was sent, but {words.output_state} says that the output is off")
        return list(words.cannot)

    def rounded(self, voltage_V: float) -> float:
        """`voltage_V` in the decimals that the instrument takes."""
        return round(voltage_V, self._dialect.decimals)

    def set_voltage(self, voltage_V: float) -> float:
        """Set the level and ask for complaints; returns when the command was on the wire."""
        sent_s = self.set_voltage_blind(voltage_V)
        self._complain()
        return sent_s

    def set_voltage_blind(self, voltage_V: float) -> float:
        """Set the level and ask nothing; returns when the command was on the wire."""
        if not math.isfinite(voltage_V):
            raise ValueError(f"voltage_V must be finite, found {voltage_V!r}")
        level = f"{voltage_V:.{self._dialect.decimals}f}"
        sent_s = self._link.write(self._dialect.set_voltage.format(level, axis=self._axis))
        self._told_V = float(level)
        return sent_s

    def voltage_setting_V(self) -> float:
        """The level as the instrument has it; what it was told, where it cannot be asked."""
        question = self._dialect.voltage_setting
        return self._told_V if question is None else self._number(question, self._dialect.setting)

    def measured_V(self) -> float | None:
        """What is at the output; None where the instrument cannot measure."""
        question = self._dialect.measure_voltage
        return None if question is None else self._number(question, self._dialect.measured)

    def measured_A(self) -> None:
        """Nothing: it cannot measure currents."""

    def is_on(self) -> bool:
        """Whether the output is switched on; True where there is no switch."""
        words = self._dialect
        if words.output_state is None:
            return True
        answer = self._ask(words.output_state)
        if re.fullmatch(words.is_on, answer) is not None:
            return True
        if re.search(r"\b(0|OFF)\b", answer) is None:
            raise BadReplyError(f"{words.output_state} was answered with {answer[:60]!r}, expected on or off")
        return False

    def confirm_off(self) -> bool:
        """Whether the output is off: the answer stands between two identifications, so it belongs to its question."""
        self._identify()
        is_off = abs(self._level_V()) < self._dialect.off_below_V if self._has_no_switch() else not self.is_on()
        self._identify()
        return is_off

    def has_tripped(self) -> bool:
        """False: there is no protection."""
        return False

    def off_blind(self) -> None:
        """Switch the output off, or set 0 V where there is no switch, and ask nothing."""
        words = self._dialect
        if words.output_off is None:
            self.set_voltage_blind(0.0)
        else:
            self._link.write(words.output_off.format(axis=self._axis))

    def reconnect(self) -> None:
        """Open the link anew and ask nothing."""
        self._link.close()
        self._link.open()

    def resync(self) -> None:
        """Identify until the answer is the right one: a late answer to an old question is not. Then take control."""
        for trial in range(_TRIALS):
            try:
                self._link.drain()
                self._identify()
                break
            except SupplyError:
                if trial == _TRIALS - 1:
                    raise
                self.reconnect()
        for command in self._dialect.prepare:
            self._link.write(command.format(axis=self._axis))
            self.patience.pause(_GAP_S)

    def release(self) -> None:
        """Give the front panel back, where it was taken."""
        if self._dialect.release is not None:
            self._link.write(self._dialect.release)

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def _has_no_switch(self) -> bool:
        return self._dialect.output_state is None

    def _level_V(self) -> float:
        """The level as well as the instrument can be asked for it."""
        if self._dialect.voltage_setting is not None:
            return self.voltage_setting_V()
        measured_V = self.measured_V()
        return self._told_V if measured_V is None else measured_V

    def _check_limit(self, bounds: Bounds) -> None:
        words = self._dialect
        if words.limit is None:
            return
        limit_V = self._number(words.limit, words.limit_answer)
        if bounds.maximum_V > limit_V:
            raise ValueError(
                f"maximum_V must be at most {limit_V:g}, as the limit switch of this {words.name} stands "
                f"({words.limit}), found {bounds.maximum_V!r}"
            )

    def _identify(self) -> Identity:
        words = self._dialect
        found = self._identity()
        if not found.manufacturer.upper().startswith(words.makers) or not found.model.upper().startswith(words.models):
            raise WrongInstrumentError(
                f"{found.manufacturer} {found.model} answers there, expected a {words.name}; correct the address or "
                f"`model` under [source]; one that is not in the list is added as {A_CLASS_OF_YOURS}"
            )
        if self._serial is not None and found.serial != self._serial:
            raise WrongInstrumentError(
                f"the {words.name} there has serial number {found.serial}, expected {self._serial}"
            )
        return self._same.check(found)

    def _identity(self) -> Identity:
        words = self._dialect
        line = self._link.query(words.identify)
        match = re.fullmatch(words.identity, line)
        end_s = time.perf_counter() + self.patience.left_s(1.0)
        for _ in range(words.identity_lines - 1):
            if match is not None or time.perf_counter() > end_s:
                break
            line = self._link.answer(words.identify)
            match = re.fullmatch(words.identity, line)
        if match is None:
            raise BadReplyError(f"{words.identify} was answered with {line[:60]!r}, expected maker, model, serial")
        if words.identity_lines > 1:
            self._link.drain()
        maker, model, serial, firmware = (group.strip() for group in match.groups())
        if words.serial is not None:
            serial = self._match(words.serial, words.serial_answer)
        return Identity(maker, model, serial, firmware)

    def _tell(self, command: str) -> None:
        self._link.write(command.format(axis=self._axis))
        self._complain(command)

    def _complain(self, command: str | None = None) -> None:
        question = self._dialect.errors
        if question is None:
            return
        answer = self._link.query(question)
        if re.fullmatch(r"\s*[-+]?\d+\b.*", answer) is None:
            raise BadReplyError(f"{question} was answered with {answer[:60]!r}, expected a code")
        if re.fullmatch(self._dialect.no_error, answer) is None:
            about = f" about {command}" if command else ""
            raise ComplaintError(f"the {self._dialect.name} complains{about}: {answer.strip()[:60]}")

    def _number(self, question: str, pattern: str) -> float:
        text = self._match(question, pattern)
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise BadReplyError(f"{question} was answered with {text[:60]!r}, expected a number")
        return number

    def _match(self, question: str, pattern: str) -> str:
        answer = self._ask(question)
        match = re.fullmatch(pattern, answer)
        if match is None:
            raise BadReplyError(f"{question} was answered with {answer[:60]!r}, which is not what it gives")
        return match[1]

    def _ask(self, question: str) -> str:
        answer = self._link.query(question.format(axis=self._axis))
        refusal = self._dialect.refusal
        if refusal is not None and refusal in answer:
            raise ComplaintError(
                f"the {self._dialect.name} did not understand a command before {question}: {answer!r:.60}"
            )
        return answer
