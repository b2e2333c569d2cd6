"""What holds for the repository as a whole: the rooms' order, the commands' form, no traces."""

import ast
import importlib
import itertools
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bender_cli.main import COMMANDS, command_parser

ROOT = Path(__file__).parents[1]
OPTIONAL = {"fmu_manipulation_toolbox", "playwright"}
"""Used where it is installed."""
CONTRACT_COMMANDS = {
    "demo", "tune", "identify", "diagnose", "hil", "reproduce", "compare", "effects", "benchmark", "calibrate", "fmu",
    "model", "investigate", "live", "bench", "fleet", "cache", "completion",
    "calibrate-model", "gallery", "simulate", "watch",
}  # fmt: skip
IMPORTED = re.compile(r"^[ \t]*(?:from|import)[ \t]+(\w+)", re.M)
TRACES = {
    "a registry's address": re.compile(r"--(?:extra-)?index-url[ =]\S|https?://[^\s)]*/simple(?:/|\b)"),
    "a path of one machine": re.compile(r"""(?:^|["'=\s(])/(?:tmp|root|home|work|Users)/"""),
}


def _repository_files() -> list[Path]:
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        pytest.skip("not a git checkout, so what belongs to the repository is unknown")
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
    return [path for name in names if name and (path := ROOT / name).is_file()]


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return ""


def test_import_contracts_hold():
    # In a process of its own, since import-linter configures logging for the whole process.
    command = [
        sys.executable,
        "-c",
        "from importlinter.cli import lint_imports; raise SystemExit(lint_imports(no_logo=True, no_cache=True))",
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " kept, 0 broken" in done.stdout


def test_no_child_imports_from_the_working_folder():
    """Every process of Python that is started here has `-P` as its first option."""
    found = []
    for path in (x for x in _repository_files() if x.suffix == ".py" and x.relative_to(ROOT).parts[0] != "tests"):
        # few files start a process
        if "sys.executable" not in (text := _text(path)):
            continue
        for node in ast.walk(ast.parse(text)):
            words = [*(ast.unparse(x) for x in ast.iter_child_nodes(node)), ""]
            for word, after in itertools.pairwise(words):
                if word == "sys.executable" and not (isinstance(node, ast.List | ast.Tuple) and after == "'-P'"):
                    found.append(f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 0)}")
    assert found == []


def test_every_folder_lists_what_it_holds():
    one_file_each = ("plant_src/bender_plant/blocks", "effects/bender_effects/library")
    for init in (path for path in _repository_files() if path.name == "__init__.py"):
        folder = init.parent
        name = folder.relative_to(ROOT).as_posix()
        if name.startswith("tests") or name in one_file_each:
            continue
        held = {path.stem for path in folder.glob("*.py")} | {path.parent.name for path in folder.glob("*/__init__.py")}
        docstring = ast.get_docstring(ast.parse(init.read_text(encoding="utf-8"))) or ""
        listed = set(re.findall(r"`(\w+)/?`", docstring))
        missing = held - {"__init__", "__main__"} - listed
        assert not missing, f"{name}/__init__.py does not list {sorted(missing)}"


def test_commands_are_those_of_the_contract():
    assert set(COMMANDS) == CONTRACT_COMMANDS


@pytest.mark.parametrize("name", COMMANDS)
def test_command_explains_itself_and_its_example_is_accepted(name: str):
    command = importlib.import_module(COMMANDS[name])
    assert command.HELP
    assert "\n" not in command.HELP
    examples = command.EXAMPLE.strip().splitlines()
    assert examples
    for example in examples:
        program, called, *words = example.partition("#")[0].split()
        assert (program, called) == ("bender", name)
        command_parser(name, command).parse_args(words)
    assert callable(command.run)


def test_no_traces_of_a_machine():
    traces = [
        f"{path.relative_to(ROOT)}:{number}: {what}"
        for path in _repository_files()
        for number, line in enumerate(_text(path).splitlines(), 1)
        for what, pattern in TRACES.items()
        if pattern.search(line)
    ]
    assert not traces


def test_pins_are_exact_and_name_no_place():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    assert pins
    assert all(re.fullmatch(r"[a-z0-9.-]+==[0-9][\w.]*", pin) for pin in pins)
    assert len({pin.partition("==")[0] for pin in pins}) == len(pins)


def test_every_requirement_is_pinned():
    from importlib.metadata import requires

    pinned = set(re.findall(r"^([a-z0-9.-]+)==", (ROOT / "constraints.txt").read_text(encoding="utf-8"), re.M))
    needed = {re.split(r"[<>=!~ \[;]", line, maxsplit=1)[0].lower() for line in requires("piezo-bender") or []}
    assert needed
    assert needed <= pinned


def _declared(text: str) -> set[str]:
    import tomllib

    project = tomllib.loads(text)["project"]
    words = [*project["dependencies"], *(x for extra in project["optional-dependencies"].values() for x in extra)]
    return {re.split(r"[<>=; \[]", word)[0].lower().replace("_", "-") for word in words}


def _provided(requirement: str) -> set[str]:
    """The names under which a package is imported; its own where it is not installed."""
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        found = distribution(requirement)
    except PackageNotFoundError:
        return {requirement.replace("-", "_")}
    listed = (found.read_text("top_level.txt") or "").split()
    return {*listed, *(file.parts[0].partition(".")[0] for file in found.files or ())}


def test_what_is_imported_at_run_time_is_declared():
    declared = _declared((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    provided = {name for requirement in declared for name in _provided(requirement)}
    ours = (*sys.stdlib_module_names, *OPTIONAL)
    for path in _repository_files():
        if path.suffix != ".py" or not path.parent.parts[len(ROOT.parts) + 1 :] or "tests" in path.parts:
            continue
        if not path.relative_to(ROOT).parts[1].startswith("bender_"):
            continue
        text = path.read_text(encoding="utf-8")
        # most files import nothing else, and reading a whole tree takes long
        if all(word in ours or word.startswith(("bender_", "piezo_bender")) for word in IMPORTED.findall(text)):
            continue
        tree = ast.parse(text)
        imported = {x.name for node in ast.walk(tree) if isinstance(node, ast.Import) for x in node.names}
        imported |= {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.module and not n.level}
        for name in {x.partition(".")[0] for x in imported}:
            if name in sys.stdlib_module_names or name.startswith(("bender_", "piezo_bender")) or name in OPTIONAL:
                continue
            assert name in provided, f"{path.relative_to(ROOT)} imports {name}, which pyproject.toml does not declare"


def test_the_licence_of_every_dependency_is_told():
    page = (ROOT / "docs" / "reference" / "dependencies.md").read_text(encoding="utf-8")
    rows = [line.split("|") for line in page.splitlines() if line.startswith("| ")]
    told = {name for row in rows for name in re.findall(r"[a-z0-9-]+", row[1])}
    assert _declared((ROOT / "pyproject.toml").read_text(encoding="utf-8")) <= told
    assert all(row[3].strip() for row in rows)


def test_no_command_needs_what_is_under_a_copyleft_licence():
    declared = _declared((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert not declared & {"pymoo", "moocore"}
