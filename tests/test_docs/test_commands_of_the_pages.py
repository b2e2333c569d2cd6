"""Every command of README, tutorial and how-to pages: its options exist, and what can run here runs, in order."""

import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import pytest

from bender_cli.main import COMMANDS, command_parser

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs/tutorial").glob("*.md")),
    *sorted((ROOT / "docs/how-to").glob("*.md")),
]
NOT_RUN = {
    "bender demo": "tests/test_studies/test_demo.py",
    "bender reproduce": "tests/test_studies/test_reproduce.py",
    "bender diagnose results/stairs": "tests/test_docs/test_your_bench.py",
    "bender tune --model results/diagnosis/model.toml --rate": "tests/test_docs/test_your_bench.py",
    "bender hil nexus": "tests/test_hil/test_run_log.py",
    "bender hil --profile": "tests/test_hil/test_hil_command.py",
    "bender hil --watch": "tests/test_hil/test_live_browser.py",
    "bender investigate": "tests/test_investigate/test_investigate_command.py",
    "bender live": "tests/test_hil/test_live_browser.py",
    "bender watch": "tests/test_watch",
    "tail -n": "tests/test_watch",
    "python build_fmu.py": "tests/test_export/test_build.py",
}
"""Commands that take minutes, real time or the checkout's own folder, and the tests that run them."""
NEEDS_HARDWARE = re.compile(r"--camera|--bench bench\.toml|across\.png")
BY_HAND = ("make ", "python3 -m venv", ". .venv", "python -m pip", "pip install", "LD_PRELOAD", "python -m fmpy.gui")
"""What installs, opens a window or preloads a library of one system."""


@dataclass(frozen=True)
class Command:
    """One line of a page, without its comment."""

    page: Path
    line: str

    @property
    def words(self) -> list[str]:
        return shlex.split(self.line)


def commands(page: Path) -> list[Command]:
    """Return the commands of the page's shell blocks, in order; a here-document belongs to its command."""
    found: list[Command] = []
    for block in re.findall(r"```sh\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        lines = iter(block.splitlines())
        for line in lines:
            command = re.sub(r"\s+#\s.*", "", line).strip()
            if not command:
                continue
            if "<<'END'" in command:
                while (more := next(lines)).strip() != "END":
                    command += "\n" + more.strip()
            found.append(Command(page, command))
    return found


ALL = [command for page in PAGES for command in commands(page)]
BENDER = [command for command in ALL if command.line.startswith("bender ")]


def _runs_here(command: Command) -> bool:
    elsewhere = (*NOT_RUN, *BY_HAND)
    return not command.line.startswith(elsewhere) and NEEDS_HARDWARE.search(command.line) is None


def test_the_pages_have_commands() -> None:
    assert len(BENDER) > 25
    shown = {command.words[1] for command in BENDER}
    assert shown <= set(COMMANDS)
    assert shown >= {"tune", "compare", "diagnose", "effects", "identify", "fmu", "hil", "calibrate", "reproduce"}


FIGURES = [
    Command(page, heading)
    for page in sorted((ROOT / "docs/reference/figures").glob("*.md"))
    for heading in re.findall(r"^##? `(bender [^`]+)`$", page.read_text(encoding="utf-8"), re.MULTILINE)
]


@pytest.mark.parametrize("command", [*BENDER, *FIGURES], ids=lambda x: f"{x.page.stem}: {x.line[:60]}")
def test_the_options_exist(command: Command) -> None:
    assert command in BENDER or command.page.stem in command.line, "the page of figures is that of its commands"
    name, *words = command.words[1:]
    command_parser(name, import_module(COMMANDS[name])).parse_args(words)


def test_what_is_not_run_here_runs_in_another_test() -> None:
    assert all((ROOT / place).exists() for place in NOT_RUN.values())
    left_out = [command for command in ALL if command.line.startswith(tuple(NOT_RUN))]
    assert left_out


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_file_that_a_command_reads_ships_was_made_before_or_is_explained(page: Path) -> None:
    """A file of the reader's own, a bench file for example, stands in the prose of the page beside what it is."""
    prose = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    made: list[str] = []
    for command in commands(page):
        if not command.line.startswith("bender "):
            made += command.words[-1:] if command.line.startswith("cp ") else re.findall(r">(\S+)", command.line)
            continue
        words = command.words
        written = [words[k + 1] for k, word in enumerate(words) if word in ("--out", "-o")]
        for name in words:
            if name in written or not re.fullmatch(r"[\w./-]+\.(csv|toml|fmu|json|ssp|xlsx|parquet)", name):
                continue
            there = (ROOT / name).is_file() or any(name == x or name.startswith(f"{x}/") for x in made)
            assert there or f"`{name}`" in prose, f"{page.name}: {command.line}: {name} is neither there nor explained"
        made += written


@pytest.mark.parametrize("page", sorted((ROOT / "docs").rglob("*.md")), ids=lambda page: page.stem)
def test_bench_toml_is_the_bench_file_of_the_reader_and_nothing_else(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    if "bench.toml" in text and page.name != "bench-file.md":
        assert "bench-file.md" in text, f"{page.name} names bench.toml and does not say what that is"
    assert not re.search(r"[\w.]/bench\.toml", text)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    "page", [page for page in PAGES if any(map(_runs_here, commands(page)))], ids=lambda page: page.stem
)
def test_the_commands_run_in_order_in_an_empty_folder(page: Path, tmp_path: Path) -> None:
    if any(command.line.startswith(("bender hil", "bender calibrate")) for command in commands(page)):
        pytest.importorskip("cv2", reason="needs the extra bench")
        pytest.importorskip("pyvisa_py", reason="needs the extra bench")
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    ran = [_run(command, tmp_path) for command in commands(page) if _runs_here(command)]
    assert ran


def _run(command: Command, folder: Path) -> str:
    program, *words = shlex.split(command.line.partition("\n")[0])
    if program == "cp":
        source = folder / words[0] if (folder / words[0]).exists() else ROOT / words[0]
        return str(shutil.copy(source, folder / words[1]))
    if program == "cat":
        (folder / words[-2].removeprefix(">")).write_text(command.line.partition("\n")[2] + "\n", encoding="utf-8")
        return words[-2]
    assert program == "bender", f"{command.page}: {command.line}: found {program}, expected a command of bender"
    done = subprocess.run(
        [sys.executable, "-m", "bender_cli", *words],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, f"{command.page}: {command.line}\n{done.stderr}"
    return done.stdout
