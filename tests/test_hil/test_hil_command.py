"""`bender hil` from the command line to the record, on the emulated bench: real processes, sockets, frames."""

import itertools
import os
from pathlib import Path

import numpy as np
import pytest
from bench_trials.camera_faults import CAMERA_FAULTS, CAMERA_STATES, run_camera_cell
from emulated_bench import PATIENT, write_as_hardware

from bender_cli.main import main
from bender_emulator.microscope.control import set_fault
from bender_hil.bench_file import emulated_bench, read_bench
from bender_hil.emulated import EmulatedBench
from bender_hil.guard.guard import Status
from bender_hil.log.read_run import read_run
from bender_hil.runner.program import ClosedLoop, OpenLoop
from bender_hil.runner.run import run
from bender_hil.runner.tip_camera import Sight
from bender_hil.runner.voltages import Voltages
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Profile, Step
from bender_loop.errors import InputError
from bender_loop.records.record import read_record

pytest.importorskip("pyvisa_py")
pytest.importorskip("cv2")
pytestmark = pytest.mark.slow


@pytest.fixture
def as_if_real(bench: EmulatedBench, tmp_path: Path) -> Path:
    return write_as_hardware(tmp_path, bench)


def _emulated(tmp_path: Path, more: str = "") -> str:
    path = tmp_path / "emulated.toml"
    path.write_text(f"[emulator]\n{more}\n{PATIENT}")
    return str(path)


def _complaint(capfd: pytest.CaptureFixture[str]) -> str:
    """The one line that is said, beside the note on whose gains these are."""
    (line,) = [x for x in capfd.readouterr().err.splitlines() if not x.startswith("note: ")]
    return line


def test_closed_loop_record_and_replay(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    out = tmp_path / "run"
    words = ["hil", "--bench", _emulated(tmp_path), "--setpoint", "8", "--duration", "2", "--out", str(out)]
    assert main(words) == 0
    assert "output off" in capfd.readouterr().out
    record = read_record(out / "record.csv")
    assert record.setpoint_um is not None
    assert record.command_time_s is not None
    assert record.supply_voltage_V is not None
    assert np.nanmean(record.displacement_um[-15:]) == pytest.approx(8.0, abs=0.5)
    assert np.all(record.command_time_s > record.time_s)
    assert record.supply_voltage_V[-1] == pytest.approx(record.voltage_V[-2], abs=0.5)
    start = read_run(out).start
    assert start["emulated"]
    assert {"bench", "calibration", "versions", "fmu", "pid", "program", "camera"} <= set(start)
    assert main(["hil", "replay", str(out)]) == 0
    assert "the same to the last bit" in capfd.readouterr().out
    assert main(words) == 2
    assert "already holds a run" in capfd.readouterr().err


def test_open_loop_with_a_hidden_effect_over_a_serial_line(tmp_path: Path):
    if os.name == "nt":
        pytest.skip("no pseudo-terminals")
    profile = tmp_path / "profile.csv"
    profile.write_text("time_s,voltage_V\n0,0\n0.3,10\n0.8,20\n1.5,0\n")
    more = 'link = "pty"\n[emulator.parameters]\n"calibration.gain" = 0.5'
    out = tmp_path / "run"
    assert main(["hil", "--bench", _emulated(tmp_path, more), "--profile", str(profile), "--out", str(out)]) == 0
    record = read_record(out / "record.csv")
    top = (record.time_s > 1.2) & (record.time_s < 1.5)
    # half of what the plant without the hidden gain does at 20 V
    assert 3.0 < np.nanmean(record.displacement_um[top]) < 9.0


def test_a_function_generator_gives_both_polarities(tmp_path: Path):
    path = tmp_path / "generator.toml"
    limits = "maximum_V = 10.0\nminimum_V = -10.0\nprotection_V = 11.0\ntravel_um = [-20.0, 20.0]\n"
    path.write_text(f'[emulator]\nsupply = "33xxx"\n{PATIENT}{limits}')
    profile = tmp_path / "both.csv"
    profile.write_text("time_s,voltage_V\n0,0\n0.3,8\n1.0,-8\n1.7,0\n")
    out = tmp_path / "run"
    assert main(["hil", "--bench", str(path), "--profile", str(profile), "--out", str(out)]) == 0
    record = read_record(out / "record.csv")
    assert (record.voltage_V.max(), record.voltage_V.min()) == (8.0, -8.0)
    assert record.supply_voltage_V is None
    assert np.nanmin(record.displacement_um) < -3.0
    assert np.nanmax(record.displacement_um) > 3.0


def test_the_same_code_drives_what_a_bench_file_names(as_if_real: Path, tmp_path: Path):
    program = OpenLoop(Voltages((0.0, 0.3), (0.0, 10.0), 0.8))
    result = run(read_bench(as_if_real), program, tmp_path / "run")
    assert (result.ended.status, result.summary.emulated) == (Status.DONE, False)
    assert result.record is not None


CELLS = [
    ("stall", "rising"), ("black", "holding"), ("freeze", "holding"), ("drop", "zeroing"), ("clock", "rising"),
    ("clock", "holding"), ("clock", "zeroing"), ("torn", "rising"), ("torn", "holding"), ("torn", "zeroing"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("fault", "state"),
    [
        pytest.param(*cell, marks=[] if cell in CELLS else pytest.mark.trial)
        for cell in itertools.product(CAMERA_FAULTS, CAMERA_STATES)
    ],
)
def test_a_camera_that_fails_ends_the_run_with_the_output_off(
    bench: EmulatedBench, tmp_path: Path, fault: str, state: str
):
    cell = run_camera_cell(bench, fault, state, tmp_path / "cell")
    assert cell.broken == ""
    if state != "zeroing":
        assert cell.code in ("camera_stalled", "frame_age", "lost_tip", "travel", "frozen")
        assert cell.code == "frozen" or fault not in ("clock", "torn")
        # a camera that stalls at the first volt has given one frame since the rest position
        assert list((tmp_path / "cell" / "run" / "frames").glob("*.png"))


@pytest.mark.parametrize("seed", range(2))
def test_a_recording_that_does_not_answer_ends_the_run_before_the_loop_has_wound_up(
    bench: EmulatedBench, as_if_real: Path, tmp_path: Path, seed: int
):
    gains, limits = Gains(0.1, 3.0), Limits()
    loop = ClosedLoop(Profile((0.0, 1.0), (4.0, 6.0 + 4.0 * seed)), gains, limits, 225.0, 20.0)

    def look_on(sight: Sight) -> None:
        if sight.number > 40:
            set_fault(bench.control_port, "recording")

    result = run(read_bench(as_if_real), loop, tmp_path / "run", witness=look_on)
    assert result.ended.code == "unanswered"
    assert "controller.response_um_per_V" in str(result.ended.sentence)
    assert max(entry["voltage_V"] for entry in read_run(tmp_path / "run").by_sequence("applied").values()) < 45.0
    assert not bench.supply.truth()["is_on"]


def test_gains_that_oscillate_end_the_run(bench: EmulatedBench, as_if_real: Path, tmp_path: Path):
    loop = ClosedLoop(Step(15.0), Gains(8.0, 60.0), Limits(), 225.0, 4.0)
    result = run(read_bench(as_if_real), loop, tmp_path / "run")
    assert result.ended.code == "oscillation"
    assert result.summary.ticks < 60
    assert not bench.supply.truth()["is_on"]


def test_no_tip_in_the_pictures_is_a_failed_run(bench: EmulatedBench, as_if_real: Path, tmp_path: Path, capfd):
    set_fault(bench.control_port, "black")
    words = ["hil", "--bench", str(as_if_real), "--setpoint", "5", "--out", str(tmp_path / "run")]
    assert main(words) == 1
    assert "rest position" in _complaint(capfd)
    assert not bench.supply.truth()["is_on"]


@pytest.mark.parametrize(
    ("old", "new", "status", "complaint"),
    [
        ("tcp://127.0.0.1:", "tcp://127.0.0.1:1#", 2, "camera"),
        ("TCPIP::127.0.0.1::", "TCPIP::127.0.0.1::1#", 1, "is it switched on"),
        ('resource = "', 'model = "9206"\nresource = "', 2, "expected B&K 9206"),
        ('resource = "', 'serial = "7"\nresource = "', 2, "serial number"),
        ("zero_frames", "zero_frame", 2, "camera.zero_frame: unknown key"),
        ("calibration.toml", "none.toml", 2, "bender calibrate"),
    ],
)
def test_what_is_not_there_is_one_line_and_the_output_stays_off(
    bench: EmulatedBench, as_if_real: Path, capfd, old: str, new: str, status: int, complaint: str
):
    text = as_if_real.read_text()
    number, _, rest = new.partition("#")
    # the port after the address is replaced with it
    before, found, after = text.partition(old)
    assert found
    if number != new:
        after = rest + after.lstrip("0123456789")
    as_if_real.write_text(before + number + after)
    assert main(["hil", "--bench", str(as_if_real), "--out", str(as_if_real.parent / "run")]) == status
    assert complaint in _complaint(capfd)
    assert (as_if_real.parent / "run").exists() == (status == 1)
    assert not bench.supply.truth()["is_on"]


def test_an_output_that_cannot_be_confirmed_off_has_a_status_of_its_own(bench: EmulatedBench, as_if_real: Path, capfd):
    as_if_real.write_text(as_if_real.read_text() + "shutdown_limit_s = 0.5\n")
    bench.supply.fault("stuck_on")
    words = ["hil", "--bench", str(as_if_real), "--setpoint", "2", "--duration", "0.5"]
    assert main([*words, "--out", str(as_if_real.parent / "run")]) == 3
    assert "OUTPUT STATE UNKNOWN" in capfd.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["--setpoint", "500"],
        ["--setpoint", "nan"],
        ["--duration", "-1"],
        ["--profile", "staircase", "--gains", "x.toml"],
        ["--gains", "none.toml"],
        ["--profile", "none.csv"],
        ["--bench", "none.toml"],
        ["replay"],
        ["replay", "none"],
    ],
)
def test_bad_words_are_one_line_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd, words: list[str]
):
    monkeypatch.chdir(tmp_path)
    assert main(["hil", *words]) == 2
    assert len(capfd.readouterr().err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_an_fmu_is_needed_for_the_emulated_bench(tmp_path: Path):
    with pytest.raises(InputError, match="needs an FMU"):
        run(emulated_bench(), OpenLoop(Voltages((0.0,), (0.0,), 1.0)), tmp_path / "run")
    assert not (tmp_path / "run").exists()
