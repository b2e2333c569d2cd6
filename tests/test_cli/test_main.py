import errno
import json
import os
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from few import few

from bender_cli import main as cli
from bender_cli.main import COMMANDS, main
from bender_loop.errors import InputError, RunError

HEAVY = ("numpy", "scipy", "matplotlib", "fmpy", "pythonfmu", "pymoo", "rich", "pydantic", "lxml")
Raise = Callable[[BaseException], None]


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch) -> Raise:
    """A command `fail` that raises what it is given."""

    def install(error: BaseException) -> None:
        def add_arguments(parser: ArgumentParser) -> None:
            parser.add_argument("--out", type=Path)

        def run(_: Namespace) -> int:
            raise error

        module = ModuleType("failing_command")
        vars(module).update(HELP="fail", EXAMPLE="bender fail", add_arguments=add_arguments, run=run)
        monkeypatch.setitem(sys.modules, "failing_command", module)
        monkeypatch.setattr(cli, "COMMANDS", {"fail": "failing_command"})

    return install


@pytest.mark.parametrize(
    ("error", "status", "sentence"),
    [
        (InputError("a.csv, line 3: found x,\nexpected y"), 2, "a.csv, line 3: found x, expected y"),
        (RunError("the solver did not converge"), 1, "the solver did not converge"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (PermissionError(errno.EACCES, "Permission denied", "out"), 2, "out: Permission denied"),
        (FileNotFoundError(errno.ENOENT, "No such file or directory", "in"), 2, "in: No such file"),
        (OSError(errno.ENOSPC, "No space left on device"), 1, "the disk is full"),
        (OSError(errno.EIO, "Input/output error", "out"), 1, "out: Input/output error"),
        (MemoryError(), 1, "out of memory"),
        (ZeroDivisionError("division by zero"), 1, "a fault in bender itself: ZeroDivisionError"),
    ],
)
def test_failures_become_one_line_and_an_exit_status(
    failing: Raise, capfd: pytest.CaptureFixture[str], error: BaseException, status: int, sentence: str
):
    failing(error)
    assert main(["fail"]) == status
    out, err = capfd.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert err.startswith(f"bender: {sentence}")


def test_interrupt_says_where_the_complete_files_are(failing: Raise, capfd: pytest.CaptureFixture[str], tmp_path: Path):
    failing(KeyboardInterrupt())
    assert main(["fail", "--out", str(tmp_path)]) == 130
    assert capfd.readouterr().err == "bender: interrupted\n"
    (tmp_path / "complete.csv").touch()
    assert main(["fail", "--out", str(tmp_path)]) == 130
    assert str(tmp_path) in capfd.readouterr().err
    assert main(["fail", "--out", str(tmp_path / "never_made")]) == 130
    assert "never_made" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ([], "name a command"),
        (["tnue"], "unknown command 'tnue'"),
        (["fmv"], "did you mean 'fmu'"),
        (["--bogus"], "--bogus"),
        (["fmu"], "ACTION"),
        (["fmu", "check"], "FILE"),
        (["fmu", "check", "a.fmu", "--fil"], "--fil"),
    ],
)
def test_bad_usage_is_one_line_and_exit_status_2(capfd: pytest.CaptureFixture[str], words: list[str], complaint: str):
    assert main(words) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert complaint in err


def test_version_is_that_of_the_distribution(capsys: pytest.CaptureFixture[str]):
    assert main(["--version"]) == 0
    name, version = capsys.readouterr().out.split()
    assert name == "piezo-bender"
    assert version[0].isdigit()


def test_help_lists_every_command(capsys: pytest.CaptureFixture[str]):
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert all(f"\n  {name} " in text for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_a_command_shows_its_example(capsys: pytest.CaptureFixture[str], name: str):
    assert main([name, "--help"]) == 0
    assert f"bender {name} " in capsys.readouterr().out.partition("example:")[2]


@pytest.mark.parametrize("words", few([["--help"], *([name, "--help"] for name in COMMANDS)], 0, 5, 10, 15))
def test_help_imports_nothing_heavy(words: list[str]):
    script = (
        "import sys; from bender_cli.main import main; status = main(sys.argv[1:]);"
        f"sys.exit(repr(sorted(set(sys.modules) & {set(HEAVY)!r})) if status == 0 else repr(status))"
    )
    done = subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == "[]"


def test_reader_that_goes_away_is_met_with_silence(tmp_path: Path):
    script = (
        "import os, sys; from bender_cli import main as cli; read, write = os.pipe(); os.close(read);"
        "os.dup2(write, 1); sys.argv = ['bender', 'fmu', 'check', sys.argv[1]]; cli.entry()"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(_broken_fmu(tmp_path))], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (141, "")


def _broken_fmu(directory: Path) -> Path:
    import zipfile

    path = directory / "broken.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription fmiVersion='2.0'/>")
    return path


def _bender(*words: str, folder: Path, **settings: Any) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "bender_cli", *words]
    return subprocess.run(command, cwd=folder, stderr=subprocess.PIPE, text=True, check=False, **settings)


@pytest.mark.parametrize("name", ["random", "argparse"])
def test_nothing_is_imported_from_the_working_folder(tmp_path: Path, name: str):
    (tmp_path / f"{name}.py").write_text("raise SystemExit(5)")
    done = _bender("--version", folder=tmp_path, stdout=subprocess.DEVNULL)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(os.name == "nt", reason="descriptors of POSIX")
@pytest.mark.parametrize("closed", few([(0,), (1,), (2,), (0, 1, 2)], 0))
def test_a_closed_descriptor_is_no_fault(tmp_path: Path, closed: tuple[int, ...]):
    def close() -> None:
        for number in closed:
            os.close(number)

    done = _bender("--version", folder=tmp_path, stdout=subprocess.DEVNULL, preexec_fn=close)
    assert done.returncode == (1 if 1 in closed else 0)
    assert len(done.stderr.splitlines()) == (1 if closed == (1,) else 0)


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_an_interrupt_while_it_loads_is_one_line(tmp_path: Path):
    code = "import bender_cli.start, os, signal; os.kill(os.getpid(), signal.SIGINT)"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "bender: interrupted\n")


def test_what_a_library_writes_below_python_does_not_reach_the_document(tmp_path: Path):
    code = """
import os, sys
from bender_cli import main as cli
def add_arguments(parser): pass
def run(arguments):
    os.write(1, b" ** On entry to DLASCL parameter number  4 had an illegal value\\n")
    sys.stdout.write("done\\n")
    return 0
HELP = EXAMPLE = ""
sys.modules["noisy"] = sys.modules["__main__"]
cli.COMMANDS = {"noisy": "noisy"}
sys.exit(cli.main(["noisy", "--json"]))
"""
    done = subprocess.run([sys.executable, "-P", "-c", code], cwd=tmp_path, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert json.loads(done.stdout)["lines"] == ["done"]
