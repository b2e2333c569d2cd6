"""The command line: usage, failures in one line, options that every command has, provenance, any terminal."""

import argparse
import errno
import hashlib
import importlib
import io
import json
import os
import shutil
import subprocess
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from few import few, few_rows

from bender_cli import main as cli
from bender_cli.main import COMMANDS, command_parser, main
from bender_export.build import ensure_plant_fmu
from bender_loop.errors import InputError, RunError
from bender_loop.shell.readable import in_ascii, make_readable
from bender_loop.shell.run import Run, current, note_input, provenance, provenance_line, running

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


def test_reader_that_goes_away_is_met_with_silence():
    script = (
        "import os, sys; from bender_cli import main as cli; read, write = os.pipe(); os.close(read);"
        "os.dup2(write, 1); sys.argv = ['bender', 'effects']; cli.entry()"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (141, "")


def _bender(*words: str, folder: Path, **settings: Any) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "bender_cli", *words]
    return subprocess.run(command, cwd=folder, stderr=subprocess.PIPE, text=True, check=False, **settings)


@pytest.mark.parametrize("name", ["random", "argparse", "signal", "threading", "typing", "re"])
def test_nothing_is_imported_from_the_working_folder(tmp_path: Path, name: str):
    (tmp_path / f"{name}.py").write_text("raise SystemExit(5)")
    done = _bender("--version", folder=tmp_path, stdout=subprocess.DEVNULL)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_process_with_an_fmu_imports_nothing_from_the_working_folder(tmp_path: Path):
    for name in ("random", "pickle", "selectors", "tempfile", "secrets", "numpy"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(5)")
    rows = "".join(f"{k / 30:.4f},{10 * (k // 30 % 3)},{1.5 * (k // 30 % 3) + 0.01 * (k % 2)}\n" for k in range(90))
    (tmp_path / "record.csv").write_text(f"time_s,voltage_V,displacement_um\n{rows}")
    fmu = str(ensure_plant_fmu("bench"))
    done = _bender("compare", "record.csv", "--fmu", fmu, "--json", "--quiet", folder=tmp_path, stdout=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["rows"] == 90


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


RECORD = Path(__file__).parents[2] / "examples" / "record.csv"
COMMON = ("--json", "--quiet", "--verbose", "--log")


def leaves(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    below = [x for x in parser._actions if isinstance(x, argparse._SubParsersAction)]
    return [leaf for x in below for one in x.choices.values() for leaf in leaves(one)] if below else [parser]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_and_every_action_has_the_common_options(name: str):
    found = leaves(command_parser(name, importlib.import_module(COMMANDS[name])))
    assert found
    for leaf in found:
        assert all(option in leaf._option_string_actions for option in COMMON), leaf.prog


def test_json_is_one_document_with_the_keys_of_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    assert main(["compare", str(RECORD), "--model", "beam", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads(Path("results/compare-record/comparison.json").read_text(encoding="utf-8"))
    told = printed["provenance"]
    assert told["command"] == f"bender compare {RECORD} --model beam --json"
    assert told["inputs"] == {str(RECORD): hashlib.sha256(RECORD.read_bytes()).hexdigest()}
    assert time.time() - time.mktime(time.strptime(told["date"][:19], "%Y-%m-%dT%H:%M:%S")) < 2 * 86400


def test_bad_input_that_shows_late_is_one_line_under_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def fail(*_: object) -> int:
        sys.stdout.write("a remark from before\n")
        raise error

    monkeypatch.setattr("bender_cli.commands.effects.run", fail)
    error: Exception = InputError("bad")
    assert main(["effects", "--json"]) == 2
    assert capsys.readouterr() == ("", "bender: bad\n")
    error = RunError("failed")
    assert main(["effects", "--json"]) == 1
    assert capsys.readouterr() == ("", "a remark from before\nbender: failed\n")


@pytest.mark.slow
def test_quiet_says_no_remark_and_verbose_says_every_step(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    strange = tmp_path / "strange.csv"
    strange.write_text(RECORD.read_text(encoding="utf-8").replace(",", ";"), encoding="utf-8")
    words = ["compare", str(strange), "--model", "beam", "--out"]
    assert main([*words, str(tmp_path / "a")]) == 0
    assert "delimiter semicolon" in capsys.readouterr().err
    assert main([*words, str(tmp_path / "b"), "--quiet"]) == 0
    found = capsys.readouterr()
    assert found.err == ""
    assert "recalibration" in found.out
    assert main([*words, str(tmp_path / "c"), "--verbose"]) == 0
    said = capsys.readouterr().err
    assert "delimiter semicolon" in said
    assert all(line.startswith("[") and " s] " in line for line in said.splitlines())
    assert main([*words, str(tmp_path / "d"), "--quiet", "--verbose"]) == 2


def test_a_log_has_the_command_the_inputs_what_was_written_and_how_it_ended(tmp_path: Path):
    log = tmp_path / "run.log"
    assert main(["compare", str(RECORD), "--model", "beam", "--out", str(tmp_path / "a"), "--log", str(log)]) == 0
    assert main(["compare", "no-such.csv", "--log", str(log)]) == 2
    text = log.read_text(encoding="utf-8")
    for words in (
        "command: bender compare",
        f"read: {RECORD}, sha256 {hashlib.sha256(RECORD.read_bytes()).hexdigest()}",
        f"written: {tmp_path / 'a' / 'comparison.json'}",
        "exit status 0",
        "ended by InputError: no-such.csv",
    ):
        assert words in text
    assert main(["effects", "--log", str(tmp_path)]) == 2


def test_outside_of_a_run_a_result_has_no_command_and_no_inputs():
    assert current() is None
    note_input(RECORD)
    assert {**provenance(), "date": "", "version": ""} == {"command": None, "version": "", "date": "", "inputs": {}}


def test_files_that_a_run_makes_itself_are_no_inputs(tmp_path: Path):
    with running(Run("bender test")) as run:
        (own := tmp_path / "own.csv").write_text("1\n", encoding="utf-8")
        # the clock of files may be a tick behind
        later_s = run.began.timestamp() + 0.01
        os.utime(own, (later_s, later_s))
        note_input(own)
        note_input(RECORD)
        assert list(run.inputs) == [str(RECORD)]
        assert "bender test" in provenance_line()
        assert RECORD.name in provenance_line()


def test_the_cache_is_shown_and_cleared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    place = tmp_path / "cache"
    (place / "kernels").mkdir(parents=True)
    (place / "PiezoBender-0.fmu").write_bytes(b"x" * 3_000_000)
    (place / "kernels" / "a.py").write_bytes(b"y" * 10)
    outside = tmp_path / "mine.txt"
    outside.write_text("mine", encoding="utf-8")
    (place / "link").symlink_to(outside)
    monkeypatch.setattr("bender_loop.shell.cache.cache_folder", lambda: place)
    assert main(["cache"]) == 0
    out = capsys.readouterr().out
    assert str(place) in out
    assert "3.0 MB in all" in out
    assert main(["cache", "--clear", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["cleared"], told["bytes"] >= 3_000_010) == (True, True)
    assert list(place.rglob("*")) == []
    assert outside.read_text(encoding="utf-8") == "mine"
    assert main(["cache"]) == 0


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_completion_knows_every_command(shell: str, capsys: pytest.CaptureFixture[str]):
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(name in script for name in COMMANDS)
    assert main(["completion", "fish"]) == 2


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
@pytest.mark.parametrize(
    ("typed", "offered"),
    [("bender dia", "diagnose"), ("bender compare --unt", "--untimed"), ("bender fmu che", "check")],
)
def test_bash_completes(tmp_path: Path, capsys: pytest.CaptureFixture[str], typed: str, offered: str):
    assert main(["completion", "bash"]) == 0
    (tmp_path / "bender").write_text(capsys.readouterr().out, encoding="utf-8")
    words = typed.split()
    script = (
        f". ./bender; COMP_WORDS=({' '.join(words)}); COMP_CWORD={len(words) - 1}; COMP_LINE='{typed}';"
        f"COMP_POINT={len(typed)}; set -- $(complete -p bender); while [ $1 != -F ]; do shift; done;"
        f'$2 bender {words[-1]} {words[-2]}; echo "${{COMPREPLY[@]}}"'
    )
    done = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert offered in done.stdout.split()


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("0.5 µm → 2 × 10⁻⁵ V²", "0.5 um -> 2 x 10^-5 V2"),
        ("−3 ± 0.1 µm/V², …", "-3 +- 0.1 um/V2, ..."),
        ("nothing to change", "nothing to change"),
        ("voltage 電圧", "voltage ??"),
    ],
)
@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
def test_a_stream_shows_what_it_can_and_the_rest_in_ascii(encoding: str, text: str, shown: str) -> None:
    data = io.BytesIO()
    stream = io.TextIOWrapper(data, encoding=encoding)
    make_readable(stream)
    stream.write(text)
    stream.flush()
    assert data.getvalue().decode(encoding) == (shown if encoding == "ascii" else text)
    assert in_ascii(text) == shown


def test_a_code_page_keeps_the_signs_that_it_has() -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="cp1252")
    make_readable(stream)
    stream.write("3 µm² → −2")
    stream.flush()
    assert stream.buffer.getvalue().decode("cp1252") == "3 µm² -> -2"  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.slow
@pytest.mark.parametrize(("encoding", "unit"), few_rows([("ascii", " um, "), ("utf-8", " µm, ")], 0))
def test_a_command_says_micrometres_as_its_terminal_can(encoding: str, unit: str, tmp_path: Path) -> None:
    words = [sys.executable, "-m", "bender_cli", "compare", str(RECORD), "--out", str(tmp_path / "out")]
    ended = subprocess.run(
        words, capture_output=True, env=os.environ | {"PYTHONIOENCODING": encoding}, cwd=tmp_path, check=False
    )
    assert ended.returncode == 0, ended.stderr
    assert unit in ended.stdout.decode(encoding)
