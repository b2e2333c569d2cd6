"""The emulated supply as SCPI sees it: commands, questions, error queue, limits, protection.

Written from the manuals and not from the driver: it takes long and short forms, chains with `;`, units, MIN and MAX,
and it has the 9115's traps (`VOLT:LIM` is the lower bound).
"""

import math
import threading
from collections import deque
from collections.abc import Callable
from time import perf_counter

import numpy as np

from bender_emulator.faults import Faults
from bender_emulator.scpi_header import header_pattern, split_command

_QUEUE_LENGTH = 20
_LEVELS_KEPT = 1000
_UNITS = {"": 1.0, "V": 1.0, "MV": 1e-3, "UV": 1e-6, "A": 1.0, "MA": 1e-3, "S": 1.0}
_ERRORS = {
    -102: "Syntax error",
    -109: "Missing parameter",
    -113: "Undefined header",
    -203: "Command protected",
    -222: "Data out of range",
    -224: "Illegal parameter value",
    -350: "Queue overflow",
}

Handler = Callable[[str], str | None]


class ScpiError(Exception):
    """A command that ends in the error queue."""

    def __init__(self, code: int) -> None:
        super().__init__(_ERRORS.get(code, "Device-specific error"))
        self.code = code


class Instrument:
    """State and language of one supply; every method may be called from any thread.

    Args:
        model: "9115" and its kin, or an XLN.
        maximum_V: its highest voltage.
        maximum_A: its highest current limit.
        rng: noise of its measurements.
        serial: its serial number.
    """

    line_end = b"\n"
    """What ends a line that is sent to it."""
    prompt = b""
    """What it sends when it has carried out a line."""

    def __init__(
        self, model: str, maximum_V: float, maximum_A: float, rng: np.random.Generator, serial: str = "EMU000001"
    ) -> None:
        self.lock = threading.RLock()
        self.faults = Faults()
        self._model, self._maximum_V, self._maximum_A, self._rng = model, maximum_V, maximum_A, rng
        self._serial = serial
        self.noise_V = self.noise_A = 0.0
        self.arrivals: deque[tuple[float, float]] = deque(maxlen=200_000)
        self._levels: deque[tuple[float, float]] = deque([(-math.inf, 0.0)], maxlen=_LEVELS_KEPT)
        self._commands, self._questions = self._tables()
        self._second: Instrument | None = None
        self.power_on()

    def power_on(self) -> None:
        """As it comes up: output off, 0 V, no faults."""
        with self.lock:
            self.faults, self._second = Faults(), None
            self.target_V, self.limit_A, self.is_on, self.is_remote = 0.0, 0.1, False, False
            self.lower_V, self.upper_V = 0.0, self._maximum_V
            self.protection_V, self.protection_on, self.tripped = 1.1 * self._maximum_V, False, False
            self.output_V = self.output_A = 0.0
            self.switched_off_s = perf_counter()
            self.errors: deque[int] = deque()

    def execute(self, line: str) -> str | None:
        """Carry out one line; returns the answers joined by `;`, None when there is none."""
        if self.faults.other_unit:
            return self._other().execute(line)
        answers = []
        with self.lock:
            for command in line.split(";"):
                if not command.strip():
                    continue
                try:
                    answer = self._one(command)
                except ScpiError as error:
                    self.complain(error.code)
                else:
                    if answer is not None:
                        answers.append(answer)
        return ";".join(answers) if answers else None

    def _other(self) -> "Instrument":
        """Return a second unit of the same model, with another serial number."""
        if self._second is None:
            self._second = Instrument(self._model, self._maximum_V, self._maximum_A, self._rng, "EMU000002")
        return self._second

    def complain(self, code: int) -> None:
        """Put an error into the queue."""
        with self.lock:
            if len(self.errors) == _QUEUE_LENGTH:
                self.errors[-1] = -350
            else:
                self.errors.append(code)

    def note_arrival(self, voltage_V: float) -> None:
        """A level was taken: when, and which."""
        self.arrivals.append((perf_counter(), voltage_V))

    @property
    def target_V(self) -> float:
        """The newest level that the output is set to."""
        return self._levels[-1][1]

    @target_V.setter
    def target_V(self, voltage_V: float) -> None:
        self._levels.append((perf_counter(), voltage_V))

    def level_V(self, time_s: float) -> float:
        """What the output is set to at `time_s`, which may be some levels ago: a busy machine is caught up with."""
        return next((level_V for at_s, level_V in reversed(self._levels) if at_s <= time_s), self._levels[0][1])

    def trip(self) -> None:
        """The overvoltage protection trips."""
        with self.lock:
            self.tripped = True
            self._switch(False)

    def _one(self, command: str) -> str | None:
        header, is_question, parameters = split_command(command)
        if is_question:
            return self._find(self._questions, header)(parameters)
        handler = self._find(self._commands, header)
        is_setting = not header.upper().startswith(("*", "SYST", ":SYST"))
        if is_setting and self.faults.local:
            raise ScpiError(-203)
        if not (is_setting and self.faults.deaf):
            handler(parameters)
        return None

    @staticmethod
    def _find(table: dict[str, Handler], header: str) -> Handler:
        for pattern, handler in table.items():
            if header_pattern(pattern).fullmatch(header):
                return handler
        raise ScpiError(-113)

    def _tables(self) -> tuple[dict[str, Handler], dict[str, Handler]]:
        commands: dict[str, Handler] = {
            "*CLS": lambda _: self.errors.clear(),
            "*RST": lambda _: self.power_on(),
            "[SOURce:]VOLTage[:LEVel][:IMMediate][:AMPLitude]": self._set_voltage,
            "[SOURce:]CURRent[:LEVel][:IMMediate][:AMPLitude]": self._set_current,
            "OUTPut[:STATe]": lambda text: self._switch(flag(text)),
            "SYSTem:REMote": lambda _: self._to_remote(True),
            "SYSTem:RWLock": lambda _: self._to_remote(True),
            "SYSTem:LOCal": lambda _: self._to_remote(False),
        }
        questions: dict[str, Handler] = {
            "*IDN": lambda _: f"B&K Precision, {self.faults.other_model or self._model}, {self._serial}, V1.01-V1.00",
            "*OPC": lambda _: "1",
            "[SOURce:]VOLTage[:LEVel][:IMMediate][:AMPLitude]": self._voltage,
            "[SOURce:]CURRent[:LEVel][:IMMediate][:AMPLitude]": lambda _: f"{self.limit_A:.3f}",
            "OUTPut[:STATe]": lambda _: self._state(),
            "SYSTem:ERRor": lambda _: self._next_error(),
        }
        own = self._xln_tables() if self._model.startswith("XLN") else self._bk_tables()
        return commands | own[0], questions | own[1]

    def _bk_tables(self) -> tuple[dict[str, Handler], dict[str, Handler]]:
        commands: dict[str, Handler] = {
            "[SOURce:]VOLTage:LIMit[:LEVel]": self._set_lower,
            "[SOURce:]VOLTage:RANGe[:LEVel]": self._set_upper,
            "[SOURce:]VOLTage:PROTection[:LEVel]": self._set_protection,
            "[SOURce:]VOLTage:PROTection:STATe": self._switch_protection,
            "PROTection:CLEar": lambda _: self._clear_protection(),
        }
        questions: dict[str, Handler] = {
            "MEASure[:SCALar]:VOLTage[:DC]": lambda _: self._reading_V(),
            "MEASure[:SCALar]:CURRent[:DC]": lambda _: self._reading_A(),
            "FETCh:VOLTage[:DC]": lambda _: self._reading_V(),
            "[SOURce:]VOLTage:LIMit[:LEVel]": lambda _: f"{self.lower_V:.3f}",
            "[SOURce:]VOLTage:RANGe[:LEVel]": lambda _: f"{self.upper_V:.3f}",
            "[SOURce:]VOLTage:PROTection[:LEVel]": lambda _: f"{self.protection_V:.3f}",
            "[SOURce:]VOLTage:PROTection:STATe": lambda _: str(int(self.protection_on)),
            "[SOURce:]VOLTage:PROTection:TRIGgered": lambda _: str(int(self.tripped)),
        }
        return commands, questions

    def _xln_tables(self) -> tuple[dict[str, Handler], dict[str, Handler]]:
        commands: dict[str, Handler] = {
            "OUT": lambda text: self._switch(flag(text)),
            "OVSET": self._set_protection,
            "CLR": lambda _: self.errors.clear(),
        }
        questions: dict[str, Handler] = {
            "VOUT": lambda _: self._reading_V(),
            "IOUT": lambda _: self._reading_A(),
            "OUT": lambda _: self._state(),
            "OVSET": lambda _: f"{self.protection_V:.3f}",
            "ERRor": lambda _: self._next_error(),
            "MODEL": lambda _: self._model,
            "STATUS": lambda _: f"{int(self.is_on):02X}",
        }
        return commands, questions

    def _set_voltage(self, text: str) -> None:
        value = number(text, self.lower_V, self.upper_V)
        if not self.lower_V <= value <= self.upper_V:
            raise ScpiError(-222)
        self.target_V = value
        self.note_arrival(value)

    def _voltage(self, text: str) -> str:
        named = {"MIN": self.lower_V, "MAX": self.upper_V}
        return f"{named.get(text.upper(), self.target_V):.3f}"

    def _set_current(self, text: str) -> None:
        self.limit_A = number(text, 0.0, self._maximum_A)

    def _set_lower(self, text: str) -> None:
        self.lower_V = number(text, 0.0, self._maximum_V)

    def _set_upper(self, text: str) -> None:
        self.upper_V = number(text, 0.0, self._maximum_V)

    def _set_protection(self, text: str) -> None:
        self.protection_V = number(text, 0.0, 1.1 * self._maximum_V)

    def _switch_protection(self, text: str) -> None:
        self.protection_on = flag(text)

    def _clear_protection(self) -> None:
        self.tripped = False

    def _switch(self, on: bool) -> None:
        if on and self.tripped:
            raise ScpiError(-203)
        if not on and (self.faults.stuck_on or self.faults.stuck_relay):
            return
        if not on and self.faults.off_delay_s:
            late = threading.Timer(self.faults.off_delay_s, self._switch_off)
            late.daemon = True
            late.start()
            return
        if on:
            self.is_on = True
        else:
            self._switch_off()

    def _switch_off(self) -> None:
        with self.lock:
            if self.is_on:
                self.switched_off_s = perf_counter()
            self.is_on = False

    def turn_panel(self, what: str, value: float) -> None:
        """Somebody at the front panel sets the level ("level"), or switches the output off ("off").

        Raises:
            ValueError: the panel has no such thing.
        """
        with self.lock:
            if what == "level":
                self.target_V = value
            elif what == "off":
                self._switch_off()
            else:
                raise ValueError(f"the panel has level and off, found {what!r}")

    def _state(self) -> str:
        return str(int(self.is_on and not self.faults.stuck_relay))

    def _to_remote(self, remote: bool) -> None:
        self.is_remote = remote
        if remote:
            self.faults = self.faults.with_fault("local", False)

    def _next_error(self) -> str:
        code = self.errors.popleft() if self.errors else -200 if self.faults.complaining else 0
        return f'{code},"{_ERRORS.get(code, "Device-specific error") if code else "No error"}"'

    def _reading_V(self) -> str:
        return self.faults.reading_V or f"{self._measured_V():.4f}"

    def _reading_A(self) -> str:
        return self.faults.reading_A or f"{self._measured_A():.5f}"

    def _measured_V(self) -> float:
        return self.output_V + self.noise_V * float(self._rng.standard_normal())

    def _measured_A(self) -> float:
        return self.output_A + self.faults.leak_A + self.noise_A * float(self._rng.standard_normal())


def flag(text: str) -> bool:
    """A switch in a command; ScpiError for anything else."""
    flags = {"ON": True, "1": True, "OFF": False, "0": False}
    if not text:
        raise ScpiError(-109)
    if text.upper() not in flags:
        raise ScpiError(-224)
    return flags[text.upper()]


def number(text: str, lowest: float, highest: float) -> float:
    """A number in a command, with its unit or by name; ScpiError for anything else or outside the bounds."""
    if not text:
        raise ScpiError(-109)
    named = {"MIN": lowest, "MINIMUM": lowest, "MAX": highest, "MAXIMUM": highest}
    if text.upper() in named:
        return named[text.upper()]
    digits = text.rstrip("VvAaMmUuSs ")
    unit = text[len(digits) :].strip().upper()
    try:
        value = float(digits) * _UNITS[unit]
    except (ValueError, KeyError):
        raise ScpiError(-102) from None
    if not lowest <= value <= highest:
        raise ScpiError(-222)
    return value
