"""Every fault of the emulated camera in the states of a run that look at it: the output ends off, with a reason."""

import time
from dataclasses import replace
from pathlib import Path

from bench_trials.fault_matrix import Cell, judged
from bench_trials.whole_run import WholeRun, has_stood, hil_words

from bender_emulator.microscope.control import clear_faults, set_fault
from bender_emulator.microscope.faults import FAULTS, RECORDING
from bender_hil.emulated import EmulatedBench, EmulationSettings
from bender_hil.guard.settings import GuardSettings
from bender_studies.bench_trials.as_hardware import HARMLESS_V, write_bench

CAMERA_FAULTS = tuple(name for name in FAULTS if name != RECORDING)
"""A recording cannot be told from a tip that rests, and in these states the command rests."""
CAMERA_STATES = ("zeroing", "rising", "holding")

PATIENT = GuardSettings(heartbeat_s=1.0, frame_age_s=0.6)
"""For a machine that does other things at the same time: what ends a run is tested here, not how soon."""
_LEVEL_V = 15.0
_AT = {"rising": (HARMLESS_V, 0.0), "holding": (_LEVEL_V, 0.4)}
"""At which level, and for how long it has stood."""
_SETTINGS = EmulationSettings()


def run_camera_cell(bench: EmulatedBench, fault: str, state: str, folder: Path) -> Cell:
    """One run on a running emulated bench, driven as hardware is, with the fault in that state.

    Args:
        bench: that nobody else uses.
        fault: of `CAMERA_FAULTS`.
        state: of `CAMERA_STATES`.
        folder: where the run goes, not there yet.
    """
    bench.supply.power_on()
    clear_faults(bench.control_port)
    folder.mkdir(parents=True)
    words = hil_words(
        write_bench(folder, bench, _SETTINGS, PATIENT), ((0.0, _LEVEL_V), (2.0, _LEVEL_V)), folder / "run"
    )
    if state == "zeroing":
        set_fault(bench.control_port, fault)
    fault_s = time.perf_counter()
    run = WholeRun(words, folder)
    try:
        if state != "zeroing":
            run.wait_for(bench.supply, has_stood(*_AT[state]))
            fault_s = time.perf_counter()
            set_fault(bench.control_port, fault)
        off_s = run.watch(bench.supply, lambda: run.process.poll() is not None, within_s=0.1)
        status = run.end()
    finally:
        run.end(0.0)
        clear_faults(bench.control_port)
    truth = bench.supply.truth()
    cell = judged(Cell(fault, state, "", None, ""), run, status, folder / "run", truth, off_s, fault_s, is_timed=False)
    return replace(cell, seconds=None, broken="; ".join(x for x in (cell.broken, _unnoticed(cell)) if x))


def _unnoticed(cell: Cell) -> str:
    if cell.status is None:
        return "no end"
    if cell.outcome == "off" and cell.status == 0:
        return "nobody noticed"
    return ""
