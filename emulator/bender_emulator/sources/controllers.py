"""Emulated sources without a switch: Thorlabs MDT693B, PI's General Command Set (an E-709), an output of a DAQ."""

import math
import re
from collections.abc import Callable
from time import perf_counter

import numpy as np

from bender_emulator.instrument import Instrument

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)", re.ASCII)


class _Controller(Instrument):
    """An amplifier without a switch: it is on from the start, and harmless at 0 V."""

    def power_on(self) -> None:
        """As it comes up: at 0 V."""
        super().power_on()
        self.is_on, self.limit_A = True, 0.1

    def _set_level(self, text: str, lowest_V: float, highest_V: float) -> bool:
        """Take a level; returns whether it is one."""
        if _NUMBER.fullmatch(text.strip()) is None or not lowest_V <= float(text) <= highest_V:
            return False
        if not self._is_held(float(text), self.target_V):
            self.target_V = float(text)
            self.note_arrival(self.target_V)
        return True

    def _is_held(self, level_V: float, present_V: float) -> bool:
        """Whether a fault keeps the output from that level: one that is stuck on does not come down at all."""
        return self.faults.deaf or (self.faults.stuck_on and abs(level_V) < abs(present_V))


class ThorlabsInstrument(_Controller):
    """MDT693B, axis x: lines end in CR, the prompt `*` comes after every command and `!` after one it does not know.

    Args:
        rng: of its voltmeter.
    """

    line_end = b"\r"
    prompt = b"*"
    limit_V = 150.0

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__("MDT693B", 150.0, 0.1, rng)

    def execute(self, line: str) -> str | None:
        """Carry out one line; an answer of several lines has CR between them."""
        word, _, value = line.strip().lower().partition("=")
        with self.lock:
            match word:
                case "" | "echo":
                    return None
                case "id?":
                    model = self.faults.other_model or "MDT693B"
                    return f"\r\rModel {model} Piezo Control Module\rFirmware Version: 1.11\rVoltage Adjustment: 0.1"
                case "serial?":
                    return "EMU000001"
                case "vlimit?":
                    return f"[ {self.limit_V:.0f}]"
                case "xvoltage?":
                    # its voltmeter reads the output in steps of 0.1 V
                    return f"[{self.faults.reading_V or format(round(self.output_V, 1), '6.1f')}]"
                case "xvoltage" if self._set_level(value, 0.0, self.limit_V):
                    return None
        return "!"


class GcsInstrument(_Controller):
    """An E-709 with one axis: `SVA`, `SVA?`, `VOL?`, `SVO`, `ERR?`.

    Args:
        rng: of its voltmeter.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__("E-709.CHG", 135.0, 0.1, rng)

    def execute(self, line: str) -> str | None:
        """Carry out one line."""
        words = line.split()
        with self.lock:
            match words:
                case ["*IDN?"]:
                    model = self.faults.other_model or "E-709.CHG"
                    return f"(c)2015 Physik Instrumente (PI) GmbH & Co. KG,{model},EMU000001,1.037"
                case ["ERR?"]:
                    code = self.errors.popleft() if self.errors else 555 if self.faults.complaining else 0
                    return str(code)
                case ["SVA?", "1"]:
                    return f"1={self.target_V:.4f}"
                case ["VOL?", "1"]:
                    return f"1={self._reading_V()}"
                case ["SVO", "1", "0" | "1"]:
                    return None
                case ["SVA", "1", value] if self._set_level(value, -30.0, 135.0):
                    return None
                case ["SVA", "1", _]:
                    self.errors.append(17)
                case _:
                    self.errors.append(2)
        return None


class DaqInstrument(_Controller):
    """The output of a DAQ behind `daq_stand_in`: `AO 1.5` is answered with ok, `AI?` with what is at the output.

    Args:
        rng: of its converter.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._buffer: tuple[float, float, list[float]] | None = None
        self.on_clock: Callable[[float, float], None] = lambda _start_s, _rate_Hz: None
        """Is told when a buffer begins, and its rate."""
        super().__init__("PCIe-6321", 10.0, 0.1, rng)

    def level_V(self, time_s: float) -> float:
        """What the output is at: a level of the buffer, or what it was set to."""
        if self._buffer is None:
            return super().level_V(time_s)
        start_s, rate_Hz, levels_V = self._buffer
        place = math.floor((time_s - start_s) * rate_Hz)
        return super().level_V(time_s) if place < 0 else levels_V[min(place, len(levels_V) - 1)]

    def power_on(self) -> None:
        """As it comes up: at 0 V, without a buffer."""
        self._buffer = None
        super().power_on()

    def execute(self, line: str) -> str | None:
        """Carry out one line."""
        with self.lock:
            match line.split():
                case ["AO", value]:
                    present_V = self.level_V(perf_counter())
                    if not self._set_level(f"{float(value):.6f}", -10.0, 10.0):
                        return "refused"
                    if self._is_held(float(value), present_V):
                        # the clock stops all the same, and the level stays
                        self.target_V = present_V
                    self._buffer = None
                    return "ok"
                case ["PLAY", rate_Hz, *values] if self._play(float(rate_Hz), [float(value) for value in values]):
                    return "ok"
                case ["AI?"]:
                    level_V = self.level_V(perf_counter())
                    return self.faults.reading_V or f"{level_V + 3e-4 * self._rng.standard_normal():.6f}"
        return "refused"

    def _play(self, rate_Hz: float, levels_V: list[float]) -> bool:
        if not levels_V or not rate_Hz > 0.0 or not all(-10.0 <= level_V <= 10.0 for level_V in levels_V):
            return False
        if not self.faults.deaf:
            start_s = perf_counter()
            self._buffer = start_s, rate_Hz, levels_V
            self.on_clock(start_s, rate_Hz)
        return True
