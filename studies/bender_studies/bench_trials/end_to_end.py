"""A bench of any kind from its first check to the diagnosis, by the commands that people type.

Source and sensor are emulated to the wire and driven as hardware is. What the bench lacks in its model, a delay and a
hysteresis, is to be found by `bender investigate` and again by `bender diagnose` from the records that lie there then.
"""

import json
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bender_hil.emulated import MICROSCOPE, EmulatedBench, EmulationSettings
from bender_hil.guard.settings import GuardSettings
from bender_hil.sources.amplifier import Amplifier
from bender_studies.bench_trials.as_hardware import HARMLESS_V, write_bench

MODEL = "bench"
HIDDEN = ("transport_delay", "rate_independent_hysteresis")
DELAY_S = 0.1
THRESHOLDS_V, WEIGHTS_UM_PER_V = (2.0, 5.0, 10.0, 18.0), (0.03, 0.03, 0.03, 0.03)
LIMITS = GuardSettings(heartbeat_s=1.0, frame_age_s=0.8, travel_um=(-20.0, 60.0))
"""Patient: what ends a run on a busy machine is not what is tried here."""
SETPOINT_UM = 8.0
_LONGEST_S = 1500.0


@dataclass(frozen=True, slots=True)
class KindOfBench:
    """A source and a sensor.

    Attributes:
        name: of the bench.
        source, sensor: as `EmulationSettings` has them.
        amplifier: behind the source.
        rate_Hz: of the sensor; None for the usual.
    """

    name: str
    source: str
    sensor: str
    amplifier: Amplifier | None = None
    rate_Hz: float | None = None


KINDS = (
    KindOfBench("supply and camera", "9115", MICROSCOPE),
    KindOfBench("generator, amplifier, DAQ input", "SDG", "daq", Amplifier(20.0), 100.0),
    KindOfBench("piezo controller and multimeter", "MDT693B", "34465A"),
    KindOfBench("E-709 and a line of text", "GCS", "text"),
    KindOfBench("DAQ output, amplifier, oscilloscope", "daq", "RedPitaya", Amplifier(20.0)),
)


@dataclass(slots=True)
class EndToEnd:
    """What came of one bench.

    Attributes:
        name: of the bench.
        statuses: exit status by command, in order; a command whose predecessor left nothing to work on is missing.
        steady_state_error_um: of the step.
        investigated, diagnosed: verdict of each, with the grade of every effect in their order.
        live: the voltages that were found at the actuator after each command, where they were not harmless.
    """

    name: str
    statuses: dict[str, int] = field(default_factory=dict)
    steady_state_error_um: float | None = None
    investigated: tuple[str, dict[str, str]] = ("", {})
    diagnosed: tuple[str, dict[str, str]] = ("", {})
    live: dict[str, float] = field(default_factory=dict)

    @property
    def broken(self) -> list[str]:
        """What should not be."""
        faults = [f"{name}: status {status}" for name, status in self.statuses.items() if status != 0]
        faults += [f"{volts:.2f} V after {name}" for name, volts in self.live.items()]
        for name, (_, effects) in (("investigate", self.investigated), ("diagnose", self.diagnosed)):
            leading = list(effects)[: len(HIDDEN)]
            faults += [f"{name}: {x} is not among the first {len(HIDDEN)}" for x in HIDDEN if x not in leading]
            faults += [f"{name}: {x}, {effects[x]}" for x in HIDDEN if effects.get(x) == "possible"]
            faults += [f"{name}: {x} is certain" for x in effects if x not in HIDDEN and effects[x] == "certain"]
        return faults


def hidden_model() -> Any:
    """Return what the benches really are."""
    from bender_plant.model import load_model

    with_delay = load_model(MODEL).with_block(HIDDEN[0], delay_s=DELAY_S)
    return with_delay.with_block(HIDDEN[1], thresholds_V=THRESHOLDS_V, weights_um_per_V=WEIGHTS_UM_PER_V)


def run_end_to_end(kind: KindOfBench, fmu: Path, folder: Path, budget_s: float) -> EndToEnd:
    """Run every command on one bench.

    Args:
        kind: of the bench.
        fmu: of `hidden_model`.
        folder: where everything goes; made here.
        budget_s: bench time of the investigation.
    """
    folder.mkdir(parents=True)
    rate = {} if kind.rate_Hz is None else {"rate_Hz": kind.rate_Hz}
    settings = EmulationSettings(supply=kind.source, sensor=kind.sensor, sensor_settings=rate)
    found = EndToEnd(kind.name)
    with EmulatedBench(settings, fmu, 30.0, amplifier=kind.amplifier) as bench:
        file = str(write_bench(folder, bench, settings, LIMITS, kind.amplifier, zero_readings=15))
        on_bench = {
            "check": ["bench", "check", "--bench", file, "--out", "check"],
            "step": ["hil", "--bench", file, "--setpoint", f"{SETPOINT_UM:g}", "--out", "step"],
            "staircase": ["hil", "--bench", file, "--profile", "staircase", "--out", "staircase"],
            "investigate": [
                *("investigate", "--bench", file, "--model", MODEL, "--budget-s", f"{budget_s:g}"),
                *("--pairs", "2", "--out", "investigation"),
            ],
        }
        for name, words in on_bench.items():
            found.statuses[name] = _bender(words, folder, name)
            volts = abs(float(bench.supply.truth()["output_V"]))
            if volts >= HARMLESS_V:
                found.live[name] = volts
    records = [str(path) for path in sorted(folder.glob("staircase/record.csv")) + _records(folder / "investigation")]
    if records:
        words = ["diagnose", *records, "--model", MODEL, "--out", "diagnosis"]
        found.statuses["diagnose"] = _bender(words, folder, "diagnose")
    step = _read(folder / "step" / "summary.json").get("step") or {}
    found.steady_state_error_um = step.get("steady_state_error_um")
    diagnoses = sorted(folder.glob("investigation/diagnosis-*/diagnosis.json"))
    found.investigated = _named(diagnoses[-1]) if diagnoses else ("", {})
    found.diagnosed = _named(folder / "diagnosis" / "diagnosis.json")
    return found


def _bender(words: list[str], folder: Path, name: str) -> int:
    """Run a command in the folder, with what it says beside; returns its exit status, 124 where it had to be ended."""
    with (folder / f"{name}.txt").open("wb") as said:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "bender_cli", *words], cwd=folder, stdout=said, stderr=subprocess.STDOUT
        )
        try:
            return process.wait(timeout=_LONGEST_S)
        except subprocess.TimeoutExpired:
            process.terminate()
            process.wait()
            return 124


def _records(investigation: Path) -> list[Path]:
    """Return the records of the excitations: the probe is weak, and gains are compared in closed loops."""
    return sorted(path for path in investigation.glob("*/record.csv") if "excitation" in path.parent.name)


def _named(path: Path) -> tuple[str, dict[str, str]]:
    told = _read(path)
    return str(told.get("verdict", "")), {effect["id"]: effect["grade"] for effect in told.get("effects", [])}


def _read(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
