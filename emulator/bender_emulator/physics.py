"""The physics of the emulated bench in real time: terminals, then the plant's FMU, then the tip board.

The clock is `time.perf_counter`; the time of step k is start + k times the step, so nothing drifts. A machine that was
busy is caught up with in equal steps, each under the level that was set at its time.
"""

import threading
import time
from collections.abc import Callable

from bender_emulator import terminals
from bender_emulator.instrument import Instrument
from bender_emulator.terminals import TerminalSettings
from bender_emulator.tip_board import TipWriter
from bender_loop.control.plant import Plant

_STEPS_AT_ONCE = 200


class Physics:
    """A thread that moves the tip.

    Args:
        instrument: whose setting drives the terminals and who measures them.
        settings: of the terminals.
        plant: reset already; from volts at the actuator to micrometres.
        board: where the tip goes.
        step_s: of the plant.
        amplifier: its output volts per input volt, and its output with 0 V at the input; None for none.
        follow: is told where the tip is, with every step; None for nobody.
    """

    def __init__(
        self,
        instrument: Instrument,
        settings: TerminalSettings,
        plant: Plant,
        board: TipWriter,
        step_s: float,
        amplifier: tuple[float, float] | None = None,
        follow: Callable[[float, float], None] | None = None,
    ) -> None:
        self._amplifier, self._follow = amplifier, follow
        self._instrument, self._settings = instrument, settings
        self._plant, self._board, self._step_s = plant, board, step_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self.tip_um = 0.0
        self.latest_s = 0.0
        """How late a step came at worst."""
        self.failure: Exception | None = None
        instrument.noise_V, instrument.noise_A = settings.noise_V, settings.noise_A

    def start(self) -> None:
        """Let time begin."""
        self._thread.start()

    def stop(self) -> None:
        """End it, and wait for that."""
        self._stop.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        start_s = time.perf_counter()
        count = 0
        try:
            while not self._stop.is_set():
                due = int((time.perf_counter() - start_s) / self._step_s)
                self.latest_s = max(self.latest_s, (due - count - 1) * self._step_s)
                for count in range(count + 1, min(due, count + _STEPS_AT_ONCE) + 1):  # noqa: B020
                    self._advance(start_s + count * self._step_s)
                time.sleep(max(0.0, start_s + (count + 1) * self._step_s - time.perf_counter()))
        except Exception as error:  # a plant may fail in any way; whoever asks for the truth is told
            self.failure = error

    def _advance(self, time_s: float) -> None:
        instrument = self._instrument
        with instrument.lock:
            faults = instrument.faults
            target_V, is_on = (instrument.level_V(time_s) + faults.offset_V) * faults.limiting, instrument.is_on
            if self._amplifier is not None:
                # an amplifier stays on, whatever is at its input
                factor, offset_V = self._amplifier
                target_V, is_on = factor * (target_V if is_on else 0.0) + offset_V, True
            instrument.output_V, instrument.output_A = terminals.step(
                self._settings, instrument.output_V, target_V, instrument.limit_A, is_on, self._step_s
            )
            voltage_V = instrument.output_V
            if instrument.protection_on and voltage_V > instrument.protection_V:
                instrument.trip()
        moved_um = self._plant.step(voltage_V, self._step_s) + faults.travel_um
        if self._follow is not None:
            self._follow(time_s, moved_um)
        self._board.publish(time_s, moved_um, (moved_um - self.tip_um) / self._step_s)
        self.tip_um = moved_um
