"""The options that every command has, and the provenance of every result."""

import argparse
import hashlib
import importlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bender_cli.main import COMMANDS, command_parser, main
from bender_loop.errors import InputError, RunError
from bender_loop.shell.run import Run, current, note_input, provenance, provenance_line, running

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


def test_json_of_a_command_without_a_document_of_its_own_has_its_lines(capsys: pytest.CaptureFixture[str]):
    assert main(["effects", "creep", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["id"] == "creep"
    assert main(["fmu", "build", "--out", "never", "--platforms", "all", "--json"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1


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


def test_a_failure_under_json_prints_nothing_but_its_line(capsys: pytest.CaptureFixture[str]):
    assert main(["compare", "no-such.csv", "--json"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("bender: no-such.csv")


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


@pytest.mark.slow
def test_something_is_said_within_the_first_seconds(tmp_path: Path):
    """A command that says nothing of its own, as a process."""
    script = (
        "import sys, time, types; from bender_cli import main as cli;"
        "from bender_loop.shell.progress import Progress;"
        "work = lambda a: Progress('counting').__enter__() and time.sleep(2.6) or 0;"
        "silent = types.ModuleType('silent');"
        "vars(silent).update(HELP='', EXAMPLE='x', add_arguments=lambda p: None, run=work);"
        "sys.modules['silent'] = silent; cli.COMMANDS = {'silent': 'silent'}; sys.argv = ['bender', 'silent'];"
        "cli.entry()"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0
    assert re.fullmatch(r"counting, [123] s\n", done.stderr)


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
