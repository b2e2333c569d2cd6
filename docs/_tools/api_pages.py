"""Sphinx extension: a page below `api/` for every folder of the packages in `api_packages`, from docstrings."""

import importlib.util
import inspect
import re
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

FOLDER = "api"
_INDEX = """\
# API

What a program or a package of yours may use, from the docstrings; the rest is read in its source. What stays
(commands, files, columns of a record, variables of the FMUs) is in the [reference](../reference/commands.md); names
here may change with any version.

```{{toctree}}
:maxdepth: 1

{pages}
```
"""
# what Sphinx would read as markup in docstrings that are plain text with `code` in backticks
_MARKUP = re.compile(r"[*|]|(?<=\w)_(?=\W|$)")
_CODE = re.compile(r"(``.+?``|`[^`]+`(?:_|__)?)")


def _source_root(package: str) -> Path:
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        message = f"{package}: found no such package, expected every room on the path; install the checkout first"
        raise ModuleNotFoundError(message)
    return Path(spec.origin).parent


NEEDS_AN_EXTRA = {"piezo_bender.bluesky"}
"""Modules that cannot be imported without an extra that the pages are built without; a how-to has them."""


def folders(package: str) -> Iterator[tuple[str, list[str]]]:
    """Yield each folder of a package that holds modules: its dotted name, and the names of its modules."""
    root = _source_root(package)
    for folder in sorted({root, *(path.parent for path in root.rglob("*.py"))}):
        if "__pycache__" in folder.parts or not (folder / "__init__.py").exists():
            continue
        dotted = ".".join([package, *folder.relative_to(root).parts])
        stems = sorted(path.stem for path in folder.glob("*.py") if path.stem not in {"__init__", "__main__"})
        yield dotted, [name for stem in stems if (name := f"{dotted}.{stem}") not in NEEDS_AN_EXTRA]


def _page(dotted: str, modules: list[str], below: list[str]) -> str:
    lines = [dotted, "=" * len(dotted), "", f".. automodule:: {dotted}", ""]
    for module in modules:
        name = module.rpartition(".")[2]
        lines += [name, "-" * len(name), "", f".. automodule:: {module}", "   :members:", ""]
    if below:
        lines += [".. toctree::", "   :caption: Folders", "   :maxdepth: 1", "", *(f"   {page}" for page in below), ""]
    return "\n".join(lines)


def write_pages(app: Sphinx) -> None:
    """Write the pages that changed, and remove those whose folder is gone."""
    place = Path(app.srcdir) / FOLDER
    place.mkdir(exist_ok=True)
    pages: dict[str, str] = {}
    for package in app.config.api_packages:
        known = dict(folders(package))
        for dotted, modules in known.items():
            below = [other for other in known if other.rpartition(".")[0] == dotted]
            pages[f"{dotted}.rst"] = _page(dotted, modules, below)
    pages["index.md"] = _INDEX.format(pages="\n".join(app.config.api_packages))
    for path in place.iterdir():
        if path.name not in pages:
            path.unlink()
    for name, text in pages.items():
        path = place / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def as_plain_text(app: Sphinx, what: str, name: str, member: Any, options: Any, lines: list[str]) -> None:
    """Escape what reStructuredText would take for markup; docstrings here are plain text with code in backticks."""
    if what == "module":
        lines[:] = _module_text(inspect.cleandoc(getattr(member, "__doc__", None) or "").splitlines())
        return
    lines[:] = _escaped("\n".join(lines)).splitlines()


def _escaped(text: str) -> str:
    parts = _CODE.split(text)
    return "".join(part if index % 2 else _MARKUP.sub(r"\\\g<0>", part) for index, part in enumerate(parts))


def _module_text(lines: list[str]) -> list[str]:
    """Return the docstring of a module with its indented runs (equations, tables) kept as they stand."""
    told: list[str] = []
    for kind, block in groupby(_marked(lines), key=lambda marked: marked[0]):
        text = [line for _, line in block]
        if kind == "verbatim":
            told += ["", "::", "", *(f"   {line}" for line in text), ""]
        elif kind == "table":
            told += ["", *_list_table(text), ""]
        elif kind == "list":
            told += [
                "",
                *("* " + _escaped(line[2:]) if line[:2] in ("* ", "- ") else _escaped(line) for line in text),
                "",
            ]
        else:
            told += _escaped("\n".join(text)).splitlines()
    return told


def _list_table(lines: list[str]) -> list[str]:
    """Return a table between bars, its head in the first line, as reStructuredText has it."""
    rows = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines if line.strip()]
    del rows[1]
    told = [".. list-table::", "   :header-rows: 1", ""]
    for row in rows:
        told += [f"   {'-' if n else '* -'} {_escaped(cell)}".replace("   - ", "     - ") for n, cell in enumerate(row)]
    return told


def _marked(lines: list[str]) -> Iterator[tuple[str, str]]:
    kind = "prose"
    for number, line in enumerate(lines):
        following = next((other for other in lines[number:] if other), "")
        if line.startswith("|"):
            kind = "table"
        elif following[:2] in ("* ", "- "):
            kind = "list"
        elif not following.startswith(" "):
            kind = "prose"
        elif kind != "list":
            kind = "verbatim"
        yield kind, line


def skip_borrowed(app: Sphinx, what: str, name: str, member: Any, skip: bool, options: Any) -> bool | None:
    """Leave out what a module took from another project and only passes on."""
    home = getattr(inspect.unwrap(member), "__module__", None) if callable(member) else None
    return True if home is not None and not home.startswith(("bender_", "piezo_bender")) else None


def index_effects(app: Sphinx, docname: str, source: list[str]) -> None:
    """Give the generated page of the effects its table of contents."""
    if docname == "effects/index":
        pages = sorted(path.stem for path in (Path(app.srcdir) / "effects").glob("*.md") if path.stem != "index")
        source[0] += "\n```{toctree}\n:hidden:\n\n" + "\n".join(pages) + "\n```\n"


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the pages and the reading of docstrings."""
    app.add_config_value("api_packages", [], "env")
    app.connect("builder-inited", write_pages)
    app.connect("source-read", index_effects)
    app.connect("autodoc-skip-member", skip_borrowed)
    # before napoleon, which writes markup of its own
    app.connect("autodoc-process-docstring", as_plain_text, priority=400)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
