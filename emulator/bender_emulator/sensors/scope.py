"""The emulated oscilloscope and the emulated Red Pitaya as SCPI sees them: records that are triggered and take time.

Written from the programmers' guides and not from the sensor's words: long and short forms, a state that says when the
record is there, samples that are rounded to the converter's steps and cut off at its ends.
"""

import math
import time

import numpy as np

from bender_emulator.instrument import Handler, ScpiError, number
from bender_emulator.sensors.scpi_sensor import ScpiSensor
from bender_emulator.sensors.transducer import Transducer

_ERRORS = {-102: "Syntax error", -109: "Missing parameter", -113: "Undefined header", -222: "Data out of range",
           -224: "Illegal parameter value"}  # fmt: skip
_SAMPLE_HZ, _BUFFER = 125e6, 16384
_UNMEASURED = "+9.9E+37"
_DIVISIONS = 10
_POINTS = 500


class RecordingInstrument(ScpiSensor):
    """What both have: a record that begins with a trigger."""

    def __init__(self, transducer: Transducer) -> None:
        self._triggered_s = -math.inf
        self._is_armed = False
        super().__init__(transducer)

    def _arm(self) -> None:
        self._is_armed, self._triggered_s = True, math.inf

    def _trigger(self) -> None:
        if self._is_armed:
            self._is_armed, self._triggered_s = False, time.perf_counter()

    def _volts(self, begin_s: float, end_s: float, count: int, most_V: float, bits: int) -> list[float]:
        """Samples as the converter gives them: in its steps, and cut off at its ends."""
        settings = self._transducer.settings
        places_um = np.array(self._transducer.samples_um(begin_s, end_s, count))
        volts = np.clip(settings.offset_V + settings.volts_per_um * places_um, -most_V, most_V)
        step_V = 2.0 * most_V / 2**bits
        return (step_V * np.round(volts / step_V)).tolist()

    def _next_error(self) -> str:
        code = self._errors.popleft() if self._errors else -200 if self.faults.complaining else 0
        return f'{code},"{_ERRORS.get(code, "Device-specific error") if code else "No error"}"'


class RedPitayaInstrument(RecordingInstrument):
    """A STEMlab 125-14: fourteen bits, a jumper for the range, a buffer with the trigger in its middle."""

    def power_on(self) -> None:
        """As it comes up."""
        self._decimation, self._delay, self._most_V = 1, 0, 1.0

    def _tables(self) -> tuple[dict[str, Handler], dict[str, Handler]]:
        commands: dict[str, Handler] = {
            "*CLS": lambda _: self._errors.clear(),
            "*RST": lambda _: self.power_on(),
            "ACQ:RST": lambda _: self.power_on(),
            "ACQ:DEC": self._set_decimation,
            "ACQ:AVG": lambda text: _one_of(text, "ON", "OFF"),
            "ACQ:DATA:FORMAT": lambda text: _one_of(text, "ASCII"),
            "ACQ:DATA:Units": lambda text: _one_of(text, "VOLTS"),
            "ACQ:SOUR1:GAIN": self._set_gain,
            "ACQ:TRig:DLY": self._set_delay,
            "ACQ:START": lambda _: self._arm(),
            "ACQ:STOP": lambda _: None,
            "ACQ:TRig": self._trigger_now,
        }
        questions: dict[str, Handler] = {
            "*IDN": lambda _: f"REDPITAYA,{self.faults.other_model or 'INSTR2024'},0,01-02",
            "ACQ:TRig:STAT": lambda _: "WAIT" if self._is_armed else "TD",
            "ACQ:TRig:FILL": lambda _: str(int(time.perf_counter() >= self._end_s)),
            "ACQ:SOUR1:DATA:LATest:N": self._latest,
            "SYSTem:ERRor[:NEXT]": lambda _: self._next_error(),
        }
        return commands, questions

    @property
    def _sample_s(self) -> float:
        return self._decimation / _SAMPLE_HZ

    @property
    def _end_s(self) -> float:
        return self._triggered_s + (_BUFFER // 2 + self._delay) * self._sample_s

    def _set_decimation(self, text: str) -> None:
        decimation = int(number(text, 1, 65536))
        if decimation & (decimation - 1):
            raise ScpiError(-224)
        self._decimation = decimation

    def _set_delay(self, text: str) -> None:
        self._delay = int(number(text, -_BUFFER // 2, 2**31))

    def _set_gain(self, text: str) -> None:
        self._most_V = {"LV": 1.0, "HV": 20.0}[_one_of(text, "LV", "HV")]

    def _trigger_now(self, text: str) -> None:
        _one_of(text, "NOW")
        self._trigger()

    def _latest(self, text: str) -> str:
        count = int(number(text, 1, _BUFFER))
        if self.faults.reading_V:
            return self.faults.reading_V
        end_s = min(self._end_s, time.perf_counter())
        samples = self._volts(end_s - count * self._sample_s, end_s, count, self._most_V, 14)
        return "{" + ",".join(f"{sample:.6f}" for sample in samples) + "}"


class KeysightInstrument(RecordingInstrument):
    """An InfiniiVision: eight bits, ten divisions, the mean of what its screen shows."""

    def power_on(self) -> None:
        """As it comes up."""
        self._range_V, self._screen_s, self._before = 40.0, 1e-3, 0.5

    def _tables(self) -> tuple[dict[str, Handler], dict[str, Handler]]:
        def nothing(_: str) -> None:
            """Taken without any effect here."""

        commands: dict[str, Handler] = {
            "*CLS": lambda _: self._errors.clear(),
            "*RST": lambda _: self.power_on(),
            "CHANnel1:DISPlay": nothing,
            "CHANnel1:COUPling": lambda text: _one_of(text, "AC", "DC"),
            "CHANnel1:OFFSet": nothing,
            "CHANnel1:RANGe": self._set_range,
            "TIMebase:MODE": lambda text: _one_of(text, "MAIN"),
            "TIMebase:REFerence": self._set_reference,
            "TIMebase:POSition": nothing,
            "TIMebase:RANGe": self._set_screen,
            "TRIGger:SWEep": lambda text: _one_of(text, "NORM", "NORMAL", "AUTO"),
            "SINGle": lambda _: self._arm(),
            "TRIGger:FORCe": lambda _: self._trigger(),
        }
        questions: dict[str, Handler] = {
            "*IDN": lambda _: f"KEYSIGHT TECHNOLOGIES,{self.faults.other_model or 'DSOX3024A'},EMU000001,02.41",
            "OPERegister:CONDition": lambda _: "8" if time.perf_counter() < self._end_s else "0",
            "MEASure:VAVerage": self._mean,
            "SYSTem:ERRor": lambda _: self._next_error(),
        }
        return commands, questions

    @property
    def _end_s(self) -> float:
        return self._triggered_s + (1.0 - self._before) * self._screen_s

    def _set_range(self, text: str) -> None:
        self._range_V = number(text, 8e-3, 400.0)

    def _set_screen(self, text: str) -> None:
        self._screen_s = number(text, 20e-9, 500.0)

    def _set_reference(self, text: str) -> None:
        self._before = {"LEFT": 1.0 / _DIVISIONS, "CENT": 0.5, "CENTER": 0.5}[_one_of(text, "LEFT", "CENT", "CENTER")]

    def _mean(self, text: str) -> str:
        if [part.strip().upper()[:4] for part in text.split(",")] != ["DISP", "CHAN"]:
            raise ScpiError(-224)
        if self.faults.reading_V:
            return self.faults.reading_V
        if not math.isfinite(self._triggered_s):
            return _UNMEASURED
        most_V = 0.5 * self._range_V
        samples = self._volts(self._end_s - self._screen_s, self._end_s, _POINTS, most_V, 8)
        return _UNMEASURED if max(map(abs, samples)) >= most_V else f"{sum(samples) / len(samples):+.5E}"


def _one_of(text: str, *known: str) -> str:
    if text.upper() not in known:
        raise ScpiError(-224)
    return text.upper()


SCOPE_INSTRUMENTS = {"RedPitaya": (RedPitayaInstrument, "\r\n"), "DSOX": (KeysightInstrument, "\n")}
"""The instrument of each kind, and what ends its answers."""
