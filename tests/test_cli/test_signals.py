"""SIGTERM and the end of a terminal do what Ctrl-C does, in every command; what is said of results is of this run."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from few import few

from bender_cli import main as cli
from bender_cli.main import main

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")

WORDS = {
    "identify": ["identify", "long.csv", "--out", "out/model.toml"],
    "reproduce": ["reproduce", "--out", "out"],
    "benchmark": ["benchmark", "tuner", "--seeds", "2"],
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    time_s = np.arange(6000) * 0.02
    voltage_V = 25.0 - 25.0 * np.cos(2.0 * np.pi * 0.2 * time_s) + 5.0 * np.sin(2.0 * np.pi * 0.73 * time_s)
    table = np.column_stack([time_s, np.clip(voltage_V, 0.0, 50.0), 0.5 * voltage_V])
    np.savetxt(tmp_path / "long.csv", table, delimiter=",", header="time_s,voltage_V,displacement_um", comments="")
    return tmp_path


@pytest.mark.parametrize("number", few([signal.SIGTERM, signal.SIGHUP], 0))
@pytest.mark.parametrize("command", few(WORDS, list(WORDS).index("identify")))
def test_a_command_ends_cleanly(command: str, number: signal.Signals, folder: Path) -> None:
    words = [sys.executable, "-m", "bender_cli", *WORDS[command]]
    with subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        process.stderr.readline()
        assert process.poll() is None
        process.send_signal(number)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert errors.splitlines()[-1].startswith("bender: interrupted")
    assert "Traceback" not in errors
    assert not list(folder.rglob("*.tmp"))


def test_a_signal_that_is_ignored_stays_ignored(folder: Path) -> None:
    def ignore() -> None:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)

    code = "import signal; from bender_cli.start import _take_interrupts as f; f(); print(repr(signal.getsignal(1)))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, preexec_fn=ignore, cwd=folder
    )
    assert "SIG_IGN" in done.stdout, done.stderr


@pytest.mark.parametrize("written", [False, True])
def test_what_is_complete_is_said_of_this_run_only(
    written: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    (out / "below").mkdir(parents=True)
    older = out / "below" / "older.json"
    older.write_text("{}", encoding="utf-8")
    os.utime(older, (time.time() - 60.0, time.time() - 60.0))

    def interrupted(words: list[str], arguments: object, _: object) -> int:
        vars(arguments)["out"] = out
        if written:
            (out / "below" / "new.json").write_text("{}", encoding="utf-8")
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "_run", interrupted)
    assert main(["demo"]) == 130
    expected = f"; what is complete is in {out}" if written else ""
    assert capsys.readouterr().err == f"bender: interrupted{expected}\n"


def test_an_interrupt_inside_of_generated_code_ends_with_the_status_of_every_interrupt(tmp_path: Path):
    # dataclasses and numba run texts by exec while they are imported
    (tmp_path / "interrupted.py").write_text(
        "import bender_cli.main as m\ndef run(*_):\n    exec('raise KeyboardInterrupt')\nm._run = run\nm.entry()\n"
    )
    words = [sys.executable, "-m", "interrupted"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 130, done.stderr
    assert done.stderr.startswith("bender: interrupted")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_is_not_dropped_while_a_command_is_loaded(number: signal.Signals, tmp_path: Path):
    # Python drops an exception that comes in a destructor, and locks of modules have such
    (tmp_path / "dropping.py").write_text(
        "import os\n"
        "class Drops:\n"
        "    def __del__(self):\n"
        f"        os.kill(os.getpid(), {int(number)})\n"
        "        for _ in range(1000): pass\n"
        "Drops()\n"
        "HELP = EXAMPLE = ''\n"
        "def add_arguments(parser): pass\n"
        "def run(arguments): print('it went on'); return 0\n"
    )
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); from bender_cli.start import entry; "
        "from bender_cli import main; main.COMMANDS = {'drop': 'dropping'}; sys.argv[1:] = ['drop']; entry()"
    )
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "bender: interrupted\n")
