"""The driver of every supply in the table: words from a dialect, answers read strictly, settings read back."""

import math

from bender_hil.supply import parse
from bender_hil.supply.capability import Capability
from bender_hil.supply.failures import ComplaintError, MismatchError, SupplyError, WrongInstrumentError
from bender_hil.supply.link import Link
from bender_hil.supply.parse import Identity
from bender_hil.supply.patience import Patience
from bender_hil.supply.same_instrument import SameInstrument
from bender_hil.supply.source import Bounds
from bender_loop.shell.plugins import A_CLASS_OF_YOURS

_QUEUE_LENGTH = 32
_RESYNC_TRIALS = 3
_SETTING_TOLERANCE_V = 2e-3
_GAP_S = 0.01
"""Between commands that nothing waits for, on the way down."""


class Supply:
    """A supply behind the `Source` protocol.

    Args:
        link: to the instrument, not open yet.
        capability: the model that must be at its end.
        serial: serial number that it must have, None for any.
        identity: what it said of itself on an earlier link, None where there was none.
    """

    def __init__(
        self, link: Link, capability: Capability, serial: str | None = None, identity: Identity | None = None
    ) -> None:
        self._link = link
        self._capability = capability
        self._dialect = capability.dialect
        self._serial = serial
        self._same = SameInstrument(identity)

    @property
    def patience(self) -> Patience:
        """The deadline of every wait."""
        return self._link.patience

    @property
    def setting_tolerance_V(self) -> float:
        """How far a level that is read back may lie from the one that was sent."""
        return _SETTING_TOLERANCE_V

    def open(self) -> Identity:
        """Open the link and identify the instrument; nothing is set before it is the right one."""
        self._link.open()
        return self._identify()

    def arm(self, bounds: Bounds) -> list[str]:
        """Output off, 0 V, bounds set and read back, output on; returns remarks on what could not be set.

        Raises:
            ValueError: the model cannot do what the bounds ask for.
            SupplyError: a setting was refused or read back differently.
        """
        self._check(bounds)
        words = self._dialect
        for command in words.prepare:
            self._link.write(command)
        self._empty_queue()
        self._tell(words.output_off)
        if self.is_on():
            raise MismatchError(f"{words.output_off} was sent, but {words.output_state} says that the output is on")
        self._set_V("0 V", words.set_voltage, words.voltage_setting, 0.0)
        remarks = [
            self._set_A(bounds.current_A),
            self._set_V("the upper bound", words.set_upper_bound, words.upper_bound, bounds.maximum_V),
            self._set_V("the protection", words.set_protection, words.protection_setting, bounds.protection_V),
            self._switch_protection(),
            *self._unwatched(),
        ]
        self._tell(words.output_on)
        if not self.is_on():
            raise MismatchError(f"{words.output_on} was sent, but {words.output_state} says that the output is off")
        return [remark for remark in remarks if remark is not None]

    def rounded(self, voltage_V: float) -> float:
        """`voltage_V` in the decimals that the model takes."""
        return round(voltage_V, self._capability.decimals)

    def set_voltage(self, voltage_V: float) -> float:
        """Set the level, then read the error queue; returns when the command was on the wire."""
        sent_s = self._link.write(self._voltage_words(voltage_V))
        self._complain()
        return sent_s

    def set_voltage_blind(self, voltage_V: float) -> float:
        """Set the level and ask nothing; returns when the command was on the wire."""
        return self._link.write(self._voltage_words(voltage_V))

    def voltage_setting_V(self) -> float:
        """The level as the instrument has it."""
        return self._number(self._dialect.voltage_setting)

    def measured_V(self) -> float | None:
        """What is at the terminals; None where the dialect has no word for it."""
        question = self._dialect.measure_voltage
        return None if question is None else self._number(question)

    def measured_A(self) -> float | None:
        """What flows; None where the dialect has no word for it."""
        question = self._dialect.measure_current
        return None if question is None else self._number(question)

    def is_on(self) -> bool:
        """Whether the output is switched on."""
        return parse.switch(self._dialect.output_state, self._link.query(self._dialect.output_state))

    def confirm_off(self) -> bool:
        """Whether the output is off: the answer stands between two identifications, so it belongs to its question."""
        self._identify()
        is_on = self.is_on()
        self._identify()
        return not is_on

    def has_tripped(self) -> bool:
        """Whether the overvoltage protection has tripped; False where the dialect has no word for it."""
        question = self._dialect.protection_tripped
        return question is not None and parse.switch(question, self._link.query(question))

    def off_blind(self) -> None:
        """Switch the output off and ask nothing."""
        self._link.write(self._dialect.output_off)

    def reconnect(self) -> None:
        """Open the link anew and ask nothing."""
        self._link.close()
        self._link.open()

    def resync(self) -> None:
        """Identify until the answer is the right one: a late answer to an old question is not. Then take control."""
        for trial in range(_RESYNC_TRIALS):
            try:
                self._identify()
                break
            except SupplyError:
                if trial == _RESYNC_TRIALS - 1:
                    raise
                self.reconnect()
                # a serial line has no connection that would take the leftovers with it
                self._link.drain()
        for command in self._dialect.prepare:
            self._link.write(command)
            self.patience.pause(_GAP_S)

    def release(self) -> None:
        """Give the front panel back, where it was taken."""
        if self._dialect.release is not None:
            self._link.write(self._dialect.release)

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def _identify(self) -> Identity:
        question = self._dialect.identify
        found = parse.identity(question, self._link.query(question))
        wanted = self._capability.model
        if not self._capability.is_answered_by(found.manufacturer, found.model):
            maker = f"{self._capability.makers[0]} " if self._capability.makers else ""
            raise WrongInstrumentError(
                f"{found.manufacturer} {found.model} answers there, expected {maker}{wanted}; correct the address or "
                "`model` under [supply]; a supply that is not in the list is added as a row of words "
                f"(docs/how-to/add-your-own.md) or as {A_CLASS_OF_YOURS}"
            )
        if self._serial is not None and found.serial != self._serial:
            raise WrongInstrumentError(f"the {wanted} there has serial number {found.serial}, expected {self._serial}")
        return self._same.check(found)

    def _check(self, bounds: Bounds) -> None:
        model = self._capability
        bounds.check(0.0, model.maximum_V, f"the {model.model}")
        if model.dialect.set_current is not None and bounds.current_A > model.maximum_A:
            raise ValueError(
                f"current_A must be at most {model.maximum_A:g} with a {model.model}, found {bounds.current_A!r}"
            )

    def _set_V(self, what: str, command: str | None, question: str | None, value_V: float) -> str | None:
        model = self._capability
        return self._set(what, (command, question), value_V, model.decimals, model.resolution_V)

    def _set_A(self, value_A: float) -> str | None:
        words, model = self._dialect, self._capability
        pair = words.set_current, words.current_setting
        return self._set("the current limit", pair, value_A, model.current_decimals, model.resolution_A)

    def _set(
        self, what: str, words: tuple[str | None, str | None], value: float, decimals: int, resolution: float
    ) -> str | None:
        """Set and read back; returns a remark where the dialect has no words for it."""
        command, question = words
        if command is None or question is None:
            return f"{what} cannot be set on a {self._capability.model} from here"
        self._tell(command.format(f"{value:.{decimals}f}"))
        self._read_back(what, question, value, resolution)
        return None

    def _unwatched(self) -> list[str]:
        """Return a remark on everything that the guard of a run cannot ask of this supply."""
        words, model = self._dialect, self._capability.model
        told = (
            (words.measure_voltage, f"a {model} does not say which voltage it gives: no other one ends a run"),
            (words.measure_current, f"a {model} does not say which current flows: none ends a run"),
            (words.errors, f"a {model} has no error queue: what it is told is read back instead"),
        )
        return [remark for question, remark in told if question is None]

    def _read_back(self, what: str, question: str, value: float, resolution: float) -> None:
        found = self._number(question)
        if abs(found - value) > resolution:
            raise MismatchError(f"{what} was set to {value:g}, but {question} says {found:g}")

    def _switch_protection(self) -> str | None:
        words = self._dialect
        if words.protection_on is None or words.protection_state is None:
            return f"the protection cannot be switched on from here: do it at the {self._capability.model}"
        self._tell(words.protection_on)
        if not parse.switch(words.protection_state, self._link.query(words.protection_state)):
            raise MismatchError(f"{words.protection_on} was sent, but {words.protection_state} says that it is off")
        return None

    def _voltage_words(self, voltage_V: float) -> str:
        if not math.isfinite(voltage_V):
            raise ValueError(f"voltage_V must be finite, found {voltage_V!r}")
        return self._dialect.set_voltage.format(f"{voltage_V:.{self._capability.decimals}f}")

    def _tell(self, command: str) -> None:
        self._link.write(command)
        self._complain(command)

    def _complain(self, command: str | None = None) -> None:
        question = self._dialect.errors
        found = None if question is None else parse.complaint(question, self._link.query(question))
        if found is not None:
            raise ComplaintError(f"the supply complains{f' about {command}' if command else ''}: {found}")

    def _empty_queue(self) -> None:
        """Take out what was in the queue before us; a queue without an end is a fault of its own."""
        question = self._dialect.errors
        if question is None:
            return
        for _ in range(_QUEUE_LENGTH):
            if parse.complaint(question, self._link.query(question)) is None:
                return
        raise ComplaintError(f"the supply's error queue does not become empty: {question} asked {_QUEUE_LENGTH} times")

    def _number(self, question: str) -> float:
        return parse.number(question, self._link.query(question))
