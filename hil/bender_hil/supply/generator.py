"""A function generator of the Agilent 33xxx family, for the sine of the paper.

Behind the same protocol as a supply: a level is a DC offset. A sine runs in the instrument itself, which keeps its
phase better than any loop. There is nothing to measure with, so the guard's band rests on the setting read back.
Words of the 33120A, 33220A, 33250A and 33500 series; an amplifier behind the generator is a factor.
"""

import math

from bender_hil.supply import parse
from bender_hil.supply.failures import ComplaintError, MismatchError, WrongInstrumentError
from bender_hil.supply.link import Link
from bender_hil.supply.parse import Identity
from bender_hil.supply.patience import Patience
from bender_hil.supply.same_instrument import SameInstrument
from bender_hil.supply.source import Bounds

_LARGEST_V = 10.0
_MAKERS = ("AGILENT", "KEYSIGHT", "HEWLETT")
_RESOLUTION_V = 1e-3


class Generator:
    """A function generator behind the `Source` protocol.

    Args:
        link: to the instrument, not open yet.
        gain: of the amplifier behind it.
        identity: what it said of itself on an earlier link, None where there was none.
    """

    def __init__(self, link: Link, gain: float = 1.0, identity: Identity | None = None) -> None:
        if not (math.isfinite(gain) and gain > 0.0):
            raise ValueError(f"gain must be a finite number > 0, found {gain!r}")
        self._link = link
        self._gain = gain
        self._same = SameInstrument(identity)

    @property
    def patience(self) -> Patience:
        """The deadline of every wait."""
        return self._link.patience

    def open(self) -> Identity:
        """Open the link and identify the instrument."""
        self._link.open()
        return self._identify()

    def _identify(self) -> Identity:
        found = parse.identity("*IDN?", self._link.query("*IDN?"))
        if not found.manufacturer.upper().startswith(_MAKERS) or not found.model.startswith("33"):
            raise WrongInstrumentError(f"{found.manufacturer} {found.model} answers there, expected Agilent 33xxx")
        return self._same.check(found)

    def arm(self, bounds: Bounds) -> list[str]:
        """Output off, high impedance load, 0 V DC, output on; returns what such an instrument cannot be told."""
        for name, found in (("maximum_V", bounds.maximum_V), ("minimum_V", bounds.minimum_V)):
            if abs(found) > _LARGEST_V * self._gain:
                raise ValueError(f"{name} must lie within {_LARGEST_V * self._gain:g} V of 0, found {found!r}")
        self._link.write("*CLS")
        self._tell("OUTP OFF")
        self._tell("OUTP:LOAD INF")
        self._tell("APPL:DC DEF,DEF,0.0000")
        if abs(self.voltage_setting_V()) > _RESOLUTION_V * self._gain:
            raise MismatchError("0 V were set, but VOLT:OFFS? says something else")
        self._tell("OUTP ON")
        if not self.is_on():
            raise MismatchError("OUTP ON was sent, but OUTP? says that the output is off")
        return ["a function generator has neither a current limit nor an overvoltage protection, and measures nothing"]

    def play_sine(self, frequency_Hz: float, amplitude_V: float, offset_V: float = 0.0) -> float:
        """A sine from the instrument itself, peak to peak twice `amplitude_V`; returns when it was on the wire.

        Raises:
            ValueError: it would leave the range of the instrument.
        """
        if not 1e-6 <= frequency_Hz <= 1e6:
            raise ValueError(f"frequency_Hz must lie within 1e-6 and 1e6, found {frequency_Hz!r}")
        if not 0.0 < amplitude_V + abs(offset_V) <= _LARGEST_V * self._gain:
            raise ValueError(f"amplitude and offset must stay within {_LARGEST_V * self._gain:g} V")
        high_V, offset = 2.0 * amplitude_V / self._gain, offset_V / self._gain
        sent_s = self._link.write(f"APPL:SIN {frequency_Hz:.6f},{high_V:.4f},{offset:.4f}")
        self._complain()
        return sent_s

    def rounded(self, voltage_V: float) -> float:
        """`voltage_V` in the decimals that the instrument takes."""
        return round(voltage_V / self._gain, 4) * self._gain

    def set_voltage(self, voltage_V: float) -> float:
        """Set the DC level and read the error queue; returns when the command was on the wire."""
        sent_s = self._link.write(self._words(voltage_V))
        self._complain()
        return sent_s

    def set_voltage_blind(self, voltage_V: float) -> float:
        """Set the DC level and ask nothing; returns when the command was on the wire."""
        return self._link.write(self._words(voltage_V))

    def voltage_setting_V(self) -> float:
        """The DC level as the instrument has it."""
        return self._gain * parse.number("VOLT:OFFS?", self._link.query("VOLT:OFFS?"))

    def measured_V(self) -> None:
        """Nothing: it cannot measure."""

    def measured_A(self) -> None:
        """Nothing: it cannot measure."""

    def is_on(self) -> bool:
        """Whether the output is switched on."""
        return parse.switch("OUTP?", self._link.query("OUTP?"))

    def confirm_off(self) -> bool:
        """Whether the output is off: the answer stands between two identifications, so it belongs to its question."""
        self._identify()
        is_on = self.is_on()
        self._identify()
        return not is_on

    def has_tripped(self) -> bool:
        """False: there is no protection."""
        return False

    def off_blind(self) -> None:
        """Switch the output off and ask nothing."""
        self._link.write("OUTP OFF")

    def reconnect(self) -> None:
        """Open the link anew and ask nothing."""
        self._link.close()
        self._link.open()

    def resync(self) -> None:
        """Throw away what is owed, and identify."""
        self._link.drain()
        self._identify()

    def release(self) -> None:
        """Give the front panel back."""
        self._link.write("SYST:LOC")

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def _words(self, voltage_V: float) -> str:
        if not math.isfinite(voltage_V):
            raise ValueError(f"voltage_V must be finite, found {voltage_V!r}")
        return f"VOLT:OFFS {voltage_V / self._gain:.4f}"

    def _tell(self, command: str) -> None:
        self._link.write(command)
        self._complain(command)

    def _complain(self, command: str | None = None) -> None:
        found = parse.complaint("SYST:ERR?", self._link.query("SYST:ERR?"))
        if found is not None:
            raise ComplaintError(f"the generator complains{f' about {command}' if command else ''}: {found}")
