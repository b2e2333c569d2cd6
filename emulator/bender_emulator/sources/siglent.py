"""The emulated function generator of Siglent's SDG series: `BSWV` and `OUTP`, answers that repeat the question."""

import math

import numpy as np

from bender_emulator.generator import LARGEST_V
from bender_emulator.instrument import Instrument, ScpiError, number


class SiglentInstrument(Instrument):
    """A DC level or a sine at its first channel, without measurement, limit, protection or error queue.

    Args:
        rng: of the terminals' noise, which nobody can read here.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._wave = {"WVTP": "SINE", "FRQ": "1000", "AMP": "4", "OFST": "0", "PHSE": "0"}
        self._since_s = 0.0
        super().__init__("SDG1032X", LARGEST_V, 0.1, rng)

    def level_V(self, time_s: float) -> float:
        """What the output is set to at `time_s`: the offset, with the sine on it where one plays."""
        if self._wave["WVTP"] != "SINE":
            return super().level_V(time_s)
        amplitude_V, phase_deg = 0.5 * float(self._wave["AMP"]), float(self._wave["PHSE"])
        turns = float(self._wave["FRQ"]) * (time_s - self._since_s) + phase_deg / 360.0
        return super().level_V(time_s) + amplitude_V * math.sin(2.0 * math.pi * turns)

    def execute(self, line: str) -> str | None:
        """Carry out one line; what it does not understand it passes over."""
        with self.lock:
            header, _, parameters = line.strip().partition(" ")
            try:
                return self._carry_out(header.upper(), parameters)
            except (ScpiError, ValueError):
                return None

    def _carry_out(self, header: str, parameters: str) -> str | None:
        match header:
            case "*IDN?":
                model = self.faults.other_model or "SDG1032X"
                return f"Siglent Technologies,{model},EMU000001,1.01.01.33R1B6"
            case "C1:OUTP?":
                return f"C1:OUTP {'ON' if self._state() == '1' else 'OFF'},LOAD,HZ,PLRT,NOR"
            case "C1:BSWV?":
                is_dc = self._wave["WVTP"] == "DC"
                sine = "" if is_dc else f",FRQ,{self._wave['FRQ']}HZ,AMP,{self._wave['AMP']}V"
                return f"C1:BSWV WVTP,{self._wave['WVTP']}{sine},OFST,{self.target_V:g}V"
            case "C1:OUTP" if parameters.upper() in ("ON", "OFF"):
                if not self.faults.deaf:
                    self._switch(parameters.upper() == "ON")
            case "C1:BSWV" if not self.faults.deaf:
                self._set_wave(parameters)
        return None

    def _set_wave(self, parameters: str) -> None:
        words = parameters.split(",")
        for name, value in zip(words[::2], words[1::2], strict=True):
            if name == "OFST":
                self.target_V = number(value, -LARGEST_V, LARGEST_V)
                self.note_arrival(self.target_V)
            self._wave[name] = value
        self._since_s = self.arrivals[-1][0] if self.arrivals else 0.0
