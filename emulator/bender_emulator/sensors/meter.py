"""The emulated multimeter as SCPI sees it: a DC voltage, one reading per trigger, an aperture that takes its time."""

import math
import time

from bender_emulator.instrument import Handler, ScpiError, number
from bender_emulator.sensors.scpi_sensor import ScpiSensor
from bender_emulator.sensors.transducer import Transducer

_ERRORS = {-102: "Syntax error", -113: "Undefined header", -222: "Data out of range", -224: "Illegal parameter value"}
_OVERLOAD = "+9.90000000E+37"
_NAMES = {
    "DMM6500": "KEITHLEY INSTRUMENTS,MODEL DMM6500,EMU000001,1.7.12b",
    "34465A": "Keysight Technologies,34465A,EMU000001,A.03.03-03.15-03.03-00.52-04-03",
}


class MeterInstrument(ScpiSensor):
    """State and language of one multimeter; every method may be called from any thread.

    Args:
        transducer: what is at its terminals.
    """

    def __init__(self, transducer: Transducer) -> None:
        self._name = _NAMES[transducer.settings.kind]
        super().__init__(transducer)

    def power_on(self) -> None:
        """As it comes up."""
        self._range_V, self._aperture_s = 10.0, 0.0166667

    def _tables(self) -> tuple[dict[str, Handler], dict[str, Handler]]:
        def nothing(_: str) -> None:
            """Taken without any effect here."""

        commands: dict[str, Handler] = {
            "*RST": lambda _: self.power_on(),
            "*CLS": lambda _: self._errors.clear(),
            "[SENSe:]FUNCtion[:ON]": self._function,
            "[SENSe:]VOLTage[:DC]:RANGe[:UPPer]": self._set_range,
            "[SENSe:]VOLTage[:DC]:APERture": self._set_aperture,
            "[SENSe:]VOLTage[:DC]:AZERo[:STATe]": nothing,
            "[SENSe:]VOLTage[:DC]:ZERO:AUTO": nothing,
            "[SENSe:]COUNt": nothing,
            "CONFigure[:VOLTage][:DC]": self._set_range,
            "TRIGger:SOURce": nothing,
            "TRIGger:DELay": nothing,
            "SAMPle:COUNt": nothing,
        }
        questions: dict[str, Handler] = {
            "*IDN": lambda _: self.faults.other_model or self._name,
            "*OPC": lambda _: "1",
            "[SENSe:]VOLTage[:DC]:APERture": lambda _: f"{self._aperture_s:.8E}",
            "[SENSe:]VOLTage[:DC]:RANGe[:UPPer]": lambda _: f"{self._range_V:.8E}",
            "READ": lambda _: self._read(),
            "SYSTem:ERRor[:NEXT]": lambda _: self._next_error(),
        }
        return commands, questions

    def _function(self, text: str) -> None:
        if text.strip("\"'").upper() not in ("VOLT", "VOLT:DC", "VOLTAGE", "VOLTAGE:DC"):
            raise ScpiError(-224)

    def _set_range(self, text: str) -> None:
        wanted_V = number(text, 0.0, 1000.0)
        self._range_V = next(range_V for range_V in (0.1, 1.0, 10.0, 100.0, 1000.0) if range_V >= wanted_V)

    def _set_aperture(self, text: str) -> None:
        self._aperture_s = number(text, 1e-5, 1.0)

    def _read(self) -> str:
        time.sleep(self._aperture_s)
        if self.faults.reading_V:
            return self.faults.reading_V
        settings = self._transducer.settings
        reading_um = self._transducer.reading_um()
        volts = settings.offset_V + settings.volts_per_um * reading_um
        return _OVERLOAD if not math.isfinite(volts) or abs(volts) > 1.2 * self._range_V else f"{volts:+.8E}"

    def _next_error(self) -> str:
        code = self._errors.popleft() if self._errors else -200 if self.faults.complaining else 0
        return f'{code},"{_ERRORS.get(code, "Device-specific error") if code else "No error"}"'
