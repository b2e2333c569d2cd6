"""Signals, kills and a second run: real processes on the emulated bench."""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from emulated_bench import PATIENT, wait_for

from bender_hil.runner import run_lock
from bender_hil.runner.interrupts import Interrupted, Interrupts
from bender_hil.runner.run_lock import sole_run, sole_run_with_note
from bender_loop.errors import InputError
from bender_loop.records.record import read_record

pytest.importorskip("pyvisa_py")
pytest.importorskip("cv2")
posix = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")


def _start(folder: Path, *words: str) -> "subprocess.Popen[str]":
    (folder / "bench.toml").write_text(f"[emulator]\n{PATIENT}")
    command = [sys.executable, "-m", "bender_hil", "--bench", "bench.toml", "--duration", "60", "--out", "run", *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, cwd=folder, **pipes)


def _ticks(folder: Path) -> int:
    with contextlib.suppress(OSError):
        return (folder / "run" / "run.jsonl").read_text().count('"tick"')
    return 0


@posix
@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT", "SIGQUIT"])
def test_a_signal_before_arming_ends_with_a_word_and_leaves_nothing(tmp_path: Path, name: str):
    process = _start(tmp_path)
    wait_for((tmp_path / "run").exists, 30.0)
    process.send_signal(getattr(signal, name))
    _, complaint = process.communicate(timeout=30.0)
    assert process.returncode == 130
    assert complaint.splitlines()[-1].startswith(f"bender: interrupted by {name} before the supply was armed")
    assert [path.name for path in tmp_path.iterdir()] == ["bench.toml"]


@posix
@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT"])
def test_a_signal_in_the_run_keeps_the_record_and_stands_in_the_last_line(tmp_path: Path, name: str):
    process = _start(tmp_path)
    wait_for(lambda: _ticks(tmp_path) > 10, 30.0)
    process.send_signal(getattr(signal, name))
    said, complaint = process.communicate(timeout=30.0)
    assert process.returncode == 130
    assert "interrupted, the output is off" in complaint
    assert said.splitlines()[-1].startswith(f"interrupted by {name}")
    assert "as planned" not in said
    assert len(read_record(tmp_path / "run" / "record.csv")) > 5


@posix
@pytest.mark.slow
def test_a_killed_run_is_recovered_by_command(tmp_path: Path):
    process = _start(tmp_path)
    wait_for(lambda: _ticks(tmp_path) > 30, 30.0)
    process.kill()
    process.communicate(timeout=30.0)
    assert not (tmp_path / "run" / "record.csv").exists()
    wait_for(lambda: '"kind": "end"' in (tmp_path / "run" / "guard.jsonl").read_text(), 30.0)
    words = [sys.executable, "-m", "bender_hil", "recover", "run"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=60.0, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].startswith("ended by a rule (controller_gone)")
    assert len(read_record(tmp_path / "run" / "record.csv")) > 25
    assert (tmp_path / "run" / "summary.json").exists()


@posix
@pytest.mark.slow
def test_the_second_of_two_runs_is_told(tmp_path: Path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    first = _start(tmp_path / "a")
    try:
        wait_for(lambda: _ticks(tmp_path / "a") > 0, 30.0)
        second = _start(tmp_path / "b", "--setpoint", "3")
        wait_for(lambda: _ticks(tmp_path / "b") > 0, 30.0)
        second.send_signal(signal.SIGINT)
        _, complaint = second.communicate(timeout=30.0)
        # on a machine with tests side by side the first may be told of a third, and the second of that one
        assert "another run is active on this machine (process " in complaint
    finally:
        first.send_signal(signal.SIGINT)
        first.communicate(timeout=30.0)


def test_two_runs_on_one_supply_are_refused_and_the_lock_ends_with_its_holder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with sole_run("ASRL7::INSTR", Path("first")) as other:
        assert other is None
        with sole_run("ASRL8::INSTR", Path("second")) as other:
            assert other is not None
            assert f"process {os.getpid()}" in other
            assert other.endswith("first")
        with pytest.raises(InputError, match="another run drives this source"), sole_run("ASRL7::INSTR", Path("b")):
            pass
    with sole_run("ASRL7::INSTR", Path("third")) as other:
        assert other is None


def test_a_second_run_is_told_of_the_first_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    told: list[str] = []
    with sole_run_with_note(None, Path("first"), told.append):
        assert told == []
        with sole_run_with_note(None, Path("second"), told.append):
            pass
    (sentence,) = told
    assert sentence.startswith(f"note: another run is active on this machine (process {os.getpid()}, ")
    assert "\n" not in sentence
    with sole_run_with_note(None, Path("third"), told.append):
        assert len(told) == 1


@posix
def test_the_lock_of_a_killed_process_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    code = (
        "import time\nfrom pathlib import Path\nfrom bender_hil.runner.run_lock import sole_run\n"
        "with sole_run('ASRL7::INSTR', Path('first')):\n    print('held', flush=True)\n    time.sleep(60)\n"
    )
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=environment) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(InputError, match=f"process {holder.pid}"), sole_run("ASRL7::INSTR", Path("second")):
            pass
        holder.kill()
    with sole_run("ASRL7::INSTR", Path("third")) as other:
        assert other is None


def test_without_a_place_for_locks_a_run_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    with sole_run("ASRL7::INSTR", Path("first")) as other:
        assert other is None


@posix
def test_a_signal_interrupts_before_and_is_remembered_after():
    before = signal.getsignal(signal.SIGTERM)
    with Interrupts() as interrupts:
        with pytest.raises(Interrupted, match="SIGTERM"):
            os.kill(os.getpid(), signal.SIGTERM)
        interrupts.signal = None
        interrupts.defer()
        os.kill(os.getpid(), signal.SIGHUP)
        assert interrupts.signal == "SIGHUP"
    assert signal.getsignal(signal.SIGTERM) is before


@posix
def test_a_hangup_stays_ignored_where_it_was():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Interrupts() as interrupts:
            os.kill(os.getpid(), signal.SIGHUP)
            assert interrupts.signal is None
    finally:
        signal.signal(signal.SIGHUP, before)


@posix
@pytest.mark.parametrize("trap", ["folder of somebody else", "folder open to all", "link as folder", "link as lock"])
def test_a_lock_is_never_written_where_somebody_else_may_have_laid_a_link(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, trap: str
):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    victim, there = tmp_path / "victim", tmp_path / "elsewhere"
    victim.write_text("precious")
    there.mkdir(mode=0o700)
    folder = tmp_path / f"bender-hil-{os.getuid()}"
    if trap == "link as folder":
        folder.symlink_to(there)
    else:
        folder.mkdir(mode=0o700)
    if trap.startswith("link"):
        (folder / "run.lock").symlink_to(victim)
    if trap == "folder of somebody else":
        if os.getuid() != 0:
            pytest.skip("only root can give a folder away")
        os.chown(folder, 12345, 12345)
    elif trap == "folder open to all":
        folder.chmod(0o777)
    with sole_run(None, tmp_path / "one") as first, sole_run(None, tmp_path / "two") as second:
        assert first is None
        assert second is not None
        assert str(tmp_path / "one") in second
    assert victim.read_text() == "precious"
    assert [x.name for x in there.iterdir()] == (["run.lock"] if trap == "link as folder" else [])
    assert trap.startswith("link") or list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("TCPIP::192.168.1.7::5025::SOCKET", "tcpip0::192.168.1.7::5025::socket"),
        ("USB0::0x1AB1::0x0E11::DP8::INSTR", "usb::0x1ab1::0x0e11::dp8::instr"),
        ("ASRL7::INSTR", " asrl7::INSTR"),
    ],
)
def test_two_spellings_of_an_address_are_one_supply(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, one: str, other: str
):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with sole_run(one, Path("a")), pytest.raises(InputError, match="another run drives"), sole_run(other, Path("b")):
        pass
    with sole_run("TCPIP1::192.168.1.7::5025::SOCKET", Path("a")), sole_run("TCPIP::192.168.1.7::5025::SOCKET", Path()):
        pass


@pytest.mark.skipif(os.name == "nt", reason="numbers of users of POSIX")
def test_every_user_has_locks_of_his_own(monkeypatch: pytest.MonkeyPatch):
    first = [str(x) for x in run_lock._folders()]
    monkeypatch.setattr(os, "getuid", lambda: 54321)
    assert str(next(run_lock._folders())).endswith("54321")
    assert str(next(run_lock._folders())) not in first
