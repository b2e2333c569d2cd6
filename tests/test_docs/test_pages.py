"""What the pages say about the repository: rooms, layers, files, links, words."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(
    [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
    + [path for path in DOCS.rglob("*.md") if "api" not in path.relative_to(DOCS).parts]
)
ARCHITECTURE = DOCS / "explanation" / "architecture.md"
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CONTRACTS = PYPROJECT["tool"]["importlinter"]["contracts"]
GENERATED = re.compile(
    r"^(\.\.|results|build|diagnosis|fmu|resources|records|bench|frames|calibration|documentation|pass-K)/"
)
"""Folders that commands write, an FMU has inside, or the reader's own."""


def _rooms() -> dict[str, str]:
    """Return the folder of every room and its package."""
    packages = PYPROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    return {str(Path(package).parent): Path(package).name for package in packages}


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def test_the_architecture_page_knows_every_room() -> None:
    rows = re.findall(r"^\| `(\w+)/` \| `(\w+)` \| .* \|$", _text(ARCHITECTURE), re.MULTILINE)
    assert dict(rows) == _rooms()


def test_the_architecture_page_has_the_order_of_the_rooms() -> None:
    (layers,) = [contract["layers"] for contract in CONTRACTS if contract["name"] == "Rooms in their order"]
    assert "```text\n" + "\n".join(layers) + "\n```" in _text(ARCHITECTURE)


@pytest.mark.parametrize("room", ["bender_discrepancy", "bender_inference"])
def test_the_architecture_page_has_the_layers_of_a_room(room: str) -> None:
    (layers,) = [contract["layers"] for contract in CONTRACTS if contract.get("containers") == [room]]
    _, _, rest = _text(ARCHITECTURE).partition(f"Inside `{room}`")
    table, _, _ = rest.partition("\nInside ")
    first_cells = re.findall(r"^\| (`.+?) \|", table, re.MULTILINE)
    assert [re.findall(r"`(\w+)`", cell) for cell in first_cells] == [layer.split(" | ") for layer in layers]


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(path: Path) -> None:
    for text, target in re.findall(
        r"\[([^\]]+)\]\(([^)\s]+)\)", re.sub(r"```.*?```", "", _text(path), flags=re.DOTALL)
    ):
        if target.startswith(("http:", "https:")):
            assert re.fullmatch(r"https?://[\w.-]+\.[a-z]+(?:/\S*)?", target), f"{text}: {target}"
            continue
        file, _, anchor = target.partition("#")
        if file == "api/index.md":
            continue  # made by `make docs`, whose warnings are errors
        page = (path.parent / file).resolve() if file else path
        assert page.exists(), f"{text}: {target}"
        assert not anchor or anchor in _anchors(page), f"{text}: {target}"


def _anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.+)$", _text(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_page_names_a_file_that_is_not_there(path: Path) -> None:
    if path.name == "CHANGELOG.md":
        return
    named = re.findall(r"`((?:[\w.-]+/)+[\w.-]*)`", _text(path))
    # ID stands for any effect
    missing = [name for name in named if "/ID." not in name and not GENERATED.match(name) and not _found(name)]
    assert not missing


def _found(name: str) -> bool:
    """Tell whether the repository has the file or folder, from its root or below a room's package."""
    return (ROOT / name).exists() or any(
        (ROOT / folder / package / name).exists() for folder, package in _rooms().items()
    )


def test_the_changelog_has_one_list_per_version_and_the_current_version_on_top() -> None:
    text = _text(ROOT / "CHANGELOG.md")
    versions = re.findall(r"^## \[([^\]]+)\]", text, re.MULTILINE)
    released = [version for version in versions if version != "Unreleased"]
    assert released[0] == PYPROJECT["project"]["version"]
    assert versions.index(released[0]) <= 1
    assert len(set(versions)) == len(versions)
    for section in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        headings = re.findall(r"^### (\w+)$", section, re.MULTILINE)
        assert len(set(headings)) == len(headings)
        assert set(headings) <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


def test_every_page_has_a_place_in_the_site() -> None:
    for folder in ("tutorial", "how-to", "explanation", "reference", "reference/figures", "decisions"):
        index = _text(DOCS / folder / "index.md")
        listed = set(re.findall(r"^[\w-]+$", index, re.MULTILINE))
        pages = {path.stem for path in (DOCS / folder).glob("*.md")} - {"index"}
        assert pages <= listed or ":glob:" in index


def test_decisions_are_numbered_without_twins() -> None:
    numbers = [int(path.name[:4]) for path in (DOCS / "decisions").glob("0*.md")]
    assert len(set(numbers)) == len(numbers)
