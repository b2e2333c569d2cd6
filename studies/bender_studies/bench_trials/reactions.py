"""Reaction times of a real run: the controller is killed or frozen, the camera stalls, and the supply's clock tells.

The controller is `python -m bender_hil` on a bench file that names addresses as for hardware; the emulated supply and
the guard are processes of their own, so nothing that is killed takes the clock with it.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from bender_emulator.microscope.control import clear_faults, set_fault
from bender_hil.emulated import EmulatedBench, EmulationSettings
from bender_hil.log.journal import read_journal
from bender_loop.errors import RunError
from bender_vision.scale import Calibration

# only POSIX can freeze a process from outside
REACTIONS = ("kill -9", "frozen", "camera stall") if hasattr(signal, "SIGSTOP") else ("kill -9", "camera stall")
_LEVEL_V = 45.0
_LONGEST_S = 20.0


@dataclass(frozen=True, slots=True)
class Reaction:
    """One trial, from a run that holds 45 V; times in ms from the event.

    Attributes:
        event: one of `REACTIONS`.
        ramp_ms: to the start of the way down.
        off_ms: to `OUTP?` answering off, by the supply's clock.
        harmless_ms: to a measured voltage below 1 V, by the guard's journal.
        code: what the guard gave as its reason.
    """

    event: str
    ramp_ms: float
    off_ms: float
    harmless_ms: float
    code: str


def measure_reactions(event: str, repeats: int, emulation: EmulationSettings, fmu: Path) -> list[Reaction]:
    """Trials of one event, each with a run of its own."""
    with EmulatedBench(emulation, fmu, 30.0) as bench:
        return [_trial(event, bench, emulation) for _ in range(repeats)]


def _trial(event: str, bench: EmulatedBench, emulation: EmulationSettings) -> Reaction:
    bench.supply.power_on()
    clear_faults(bench.control_port)
    with tempfile.TemporaryDirectory(prefix="bender-reaction-") as name:
        folder = Path(name)
        controller = _start(bench, emulation, folder)
        try:
            _wait_for_level(bench, controller)
            event_s = time.perf_counter()
            if event == "camera stall":
                set_fault(bench.control_port, "stall")
            elif event == "kill -9":
                controller.kill()
            else:
                os.kill(controller.pid, signal.SIGSTOP)
            off_s = _wait_until_off(bench)
            entries = _wait_for_end(folder / "run" / "guard.jsonl")
        finally:
            controller.kill()
            controller.wait()
    when = {entry["kind"]: entry["t"] for entry in entries}
    code = next(entry["code"] for entry in entries if entry["kind"] == "trip")
    times = [1e3 * (value - event_s) for value in (when["ramp"], off_s, when["harmless"])]
    return Reaction(event, times[0], times[1], times[2], code)


def _start(bench: EmulatedBench, emulation: EmulationSettings, folder: Path) -> subprocess.Popen[bytes]:
    (folder / "hold.csv").write_text(f"time_s,voltage_V\n0,{_LEVEL_V}\n60,{_LEVEL_V}\n")
    Calibration.of_scale(1.5).save(folder / "calibration.toml")
    (folder / "bench.toml").write_text(
        f'[supply]\nresource = "{bench.resource}"\nmodel = "{emulation.supply}"\nbaud = {emulation.baud}\n'
        f'[camera]\nsource = "{bench.stream}"\ncalibration = "calibration.toml"\n'
    )
    words = [sys.executable, "-P", "-m", "bender_hil", "--bench", "bench.toml", "--profile", "hold.csv", "--out", "run"]
    return subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _wait_for_level(bench: EmulatedBench, controller: "subprocess.Popen[bytes]") -> None:
    end_s = time.perf_counter() + _LONGEST_S
    while bench.supply.truth()["output_V"] < _LEVEL_V - 0.5:
        if time.perf_counter() > end_s or controller.poll() is not None:
            raise RunError(f"the run did not get to {_LEVEL_V:g} V")
        time.sleep(0.02)
    time.sleep(0.5)


def _wait_until_off(bench: EmulatedBench) -> float:
    end_s = time.perf_counter() + _LONGEST_S
    while (truth := bench.supply.truth())["is_on"]:
        if time.perf_counter() > end_s:
            raise RunError("the output did not go off")
        time.sleep(0.002)
    return float(truth["switched_off_s"])


def _wait_for_end(journal: Path) -> list[dict]:
    end_s = time.perf_counter() + _LONGEST_S
    while time.perf_counter() < end_s:
        entries = list(read_journal(journal))
        if entries and entries[-1]["kind"] == "end":
            return entries
        time.sleep(0.05)
    raise RunError("the guard did not come to its end")
