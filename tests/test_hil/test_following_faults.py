"""Faults of the camera while a model is followed: the guard ends the run as with any other program."""

import os
import time
from pathlib import Path

import pytest
from bench_trials.camera_faults import CAMERA_FAULTS
from emulated_bench import write_as_hardware
from following_controllers import tuned_on
from foreign_fmus import foreign_fmu, needs_compiler

from bender_emulator.microscope.control import clear_faults, set_fault
from bender_export.build import ensure_plant_fmu
from bender_hil.bench_file import read_bench
from bender_hil.emulated import EmulatedBench
from bender_hil.guard.guard import Status
from bender_hil.runner.following_program import following
from bender_hil.runner.program import ClosedLoop
from bender_hil.runner.run import run
from bender_hil.runner.tip_camera import Sight
from bender_loop.control.references import Profile

pytest.importorskip("pyvisa_py")
pytest.importorskip("cv2")
pytestmark = pytest.mark.slow
RATE_HZ, PATIENT = 30.0, "[guard]\nheartbeat_s = 1.0\nframe_age_s = 0.6\n"


@pytest.mark.parametrize("tick", [2, 15])
@pytest.mark.parametrize("fault", CAMERA_FAULTS)
def test_every_fault_ends_a_run_that_follows_a_model_with_the_output_off(
    bench: EmulatedBench, tmp_path: Path, fault: str, tick: int
):
    as_hardware = read_bench(write_as_hardware(tmp_path, bench, PATIENT))
    fmu = ensure_plant_fmu("bench")
    tuned = tuned_on(fmu)
    # a set-point that goes on moving, so that a picture that does not is noticed
    steps = Profile(tuple(0.5 * k for k in range(8)), tuple(5.0 + 2.0 * (k % 2) for k in range(8)))
    plain = ClosedLoop(steps, tuned.gains, tuned.limits, 225.0, 4.0)
    seen = 0

    def look_on(_: Sight) -> None:
        nonlocal seen
        seen += 1
        if seen == tick:
            set_fault(bench.control_port, fault)

    with following(plain, tuned.model, fmu, RATE_HZ, preview=False) as program:
        ended = run(as_hardware, program, tmp_path / "run", witness=look_on).ended
    clear_faults(bench.control_port)
    assert ended.code is not None
    assert ended.status is not Status.UNCONFIRMED
    assert not bench.supply.truth()["is_on"]


@needs_compiler
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("hostile", ["hang", "crash"])
def test_a_followed_model_that_takes_its_process_along_ends_the_run_with_the_output_off(
    bench: EmulatedBench, tmp_path: Path, hostile: str
):
    """The run goes on to say how it ended: nobody waits for an FMU that computes for ever."""
    as_hardware = read_bench(write_as_hardware(tmp_path, bench, PATIENT))
    fmu = foreign_fmu(tmp_path / "late.fmu", hostile=hostile, after=1500)
    tuned = tuned_on(fmu, input="drive.u", output="sensor.y")
    steps = Profile(tuple(0.2 * k for k in range(40)), tuple(2.0 + k % 2 for k in range(40)))
    plain = ClosedLoop(steps, tuned.gains, tuned.limits, 225.0, 60.0)
    with following(plain, tuned.model, fmu, RATE_HZ, preview=False) as program:
        begun_s = time.monotonic()
        result = run(as_hardware, program, tmp_path / "run")
    assert result.ended.code in ("heartbeat", "frame_age", "controller_failed")
    assert "late.fmu" in str(result.ended.sentence)
    assert result.ended.status is not Status.UNCONFIRMED
    assert time.monotonic() - begun_s < 45.0
    assert not bench.supply.truth()["is_on"]
