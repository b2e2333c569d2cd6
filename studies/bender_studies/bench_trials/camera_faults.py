"""Every fault of the emulated camera in the states of a run that look at it: the output ends off, with a reason."""

from pathlib import Path

from bender_emulator.microscope.control import clear_faults, set_fault
from bender_emulator.microscope.faults import FAULTS, RECORDING
from bender_hil.bench_file import BenchFile, CameraTable
from bender_hil.calibration.scale import Calibration
from bender_hil.emulated import EmulatedBench
from bender_hil.guard.guard import Status
from bender_hil.guard.settings import GuardSettings
from bender_hil.guard.start import OutputUnknownError
from bender_hil.log.journal import read_journal
from bender_hil.log.read_run import GUARD
from bender_hil.runner.program import OpenLoop
from bender_hil.runner.run import run
from bender_hil.runner.tip_camera import Sight
from bender_hil.runner.voltages import Voltages
from bender_hil.supply.select import SupplySettings
from bender_loop.errors import InputError, RunError
from bender_studies.bench_trials.fault_matrix import Cell

CAMERA_FAULTS = tuple(name for name in FAULTS if name != RECORDING)
"""A recording cannot be told from a tip that rests, and in these states the command rests."""
CAMERA_STATES = ("zeroing", "rising", "holding")

PATIENT = GuardSettings(heartbeat_s=1.0, frame_age_s=0.6)
"""For a machine that does other things at the same time: what ends a run is tested here, not how soon."""
_LEVEL_V = 15.0
_TICK = {"rising": 2, "holding": 15}


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
    Calibration.told(1.5).save(folder / "calibration.toml")
    as_hardware = BenchFile(
        source=SupplySettings(bench.resource),
        camera=CameraTable(source=bench.stream, calibration=str(folder / "calibration.toml"), zero_frames=5),
        guard=PATIENT,
    )
    seen = 0

    def look_on(_: Sight) -> None:
        nonlocal seen
        seen += 1
        if seen == _TICK.get(state):
            set_fault(bench.control_port, fault)

    if state == "zeroing":
        set_fault(bench.control_port, fault)
    outcome, code = "refused", None
    try:
        ended = run(as_hardware, OpenLoop(Voltages((0.0,), (_LEVEL_V,), 4.0)), folder / "run", witness=look_on).ended
        outcome, code = ("alarm" if ended.status is Status.UNCONFIRMED else "off"), ended.code
    except OutputUnknownError:
        outcome = "alarm"
    except (InputError, RunError):
        pass
    clear_faults(bench.control_port)
    truth = bench.supply.truth()
    broken = _broken(outcome, code, state, truth, folder / "run" / GUARD)
    return Cell(fault, state, outcome, code, float(truth["output_V"]), broken)


def _broken(outcome: str, code: str | None, state: str, truth: dict[str, object], journal: Path) -> str:
    if truth["is_on"]:
        return "the output is on"
    if outcome == "off" and code is None:
        return "nobody noticed"
    if outcome == "refused" and state != "zeroing":
        return "the run did not begin"
    if journal.exists() and list(read_journal(journal))[-1]["kind"] not in ("end", "refused"):
        return "the journal has no end"
    return ""
