"""The emulated function generator: the words of the Agilent 33xxx family that a bench needs."""

import math

import numpy as np

from bender_emulator.instrument import Handler, Instrument, ScpiError, flag, number

LARGEST_V = 10.0


class GeneratorInstrument(Instrument):
    """A DC level or a sine at an output without measurement, limit or protection.

    Args:
        rng: of the terminals' noise, which nobody can read here.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._amplitude_V = self._frequency_Hz = self._since_s = 0.0
        super().__init__("33220A", LARGEST_V, 0.1, rng)

    def level_V(self, time_s: float) -> float:
        """What the output is set to at `time_s`: the offset, with the sine on it."""
        if self._amplitude_V == 0.0:
            return super().level_V(time_s)
        return super().level_V(time_s) + self._amplitude_V * math.sin(
            2.0 * math.pi * self._frequency_Hz * (time_s - self._since_s)
        )

    def _tables(self) -> tuple[dict[str, Handler], dict[str, Handler]]:
        commands: dict[str, Handler] = {
            "*CLS": lambda _: self.errors.clear(),
            "OUTPut[:STATe]": lambda text: self._switch(flag(text)),
            "OUTPut:LOAD": lambda _: None,
            "APPLy:DC": self._apply_dc,
            "APPLy:SINusoid": self._apply_sine,
            "VOLTage:OFFSet": self._set_offset,
            "SYSTem:REMote": lambda _: self._to_remote(True),
            "SYSTem:LOCal": lambda _: self._to_remote(False),
        }
        questions: dict[str, Handler] = {
            "*IDN": lambda _: f"Agilent Technologies,{self.faults.other_model or '33220A'},EMU000001,2.00-2.00-22-2",
            "*OPC": lambda _: "1",
            "OUTPut[:STATe]": lambda _: self._state(),
            "VOLTage:OFFSet": lambda _: f"{self.target_V:+.5E}",
            "SYSTem:ERRor": lambda _: self._next_error(),
        }
        return commands, questions

    def _apply_dc(self, text: str) -> None:
        *_, offset = self._three(text)
        self._set_offset(offset)
        self._amplitude_V = 0.0

    def _apply_sine(self, text: str) -> None:
        frequency, amplitude, offset = self._three(text)
        peak_to_peak = number(amplitude, 0.0, 2.0 * LARGEST_V)
        self._set_offset(offset)
        self._frequency_Hz, self._amplitude_V = number(frequency, 1e-6, 2e7), 0.5 * peak_to_peak
        self._since_s = self.arrivals[-1][0]

    def _set_offset(self, text: str) -> None:
        value = number(text, -LARGEST_V, LARGEST_V)
        self.target_V = value
        self.note_arrival(value)

    @staticmethod
    def _three(text: str) -> tuple[str, str, str]:
        parts = [part.strip() for part in text.split(",")]
        if len(parts) != 3:
            raise ScpiError(-109)
        return parts[0], parts[1], parts[2]
