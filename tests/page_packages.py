"""The package of a how-to page: written as the page says, made known as an installer does, and used by `bender`."""

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path


def written(page: str, folder: Path) -> Path:
    """Write the files of a page into a folder and return it."""
    for name, text in re.findall(r"```(?:toml|python)\n# (\S+)\n(.*?)```", page, re.DOTALL):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def made_known(folder: Path, name: str, groups: Mapping[str, Mapping[str, str]]) -> None:
    """Write what an installer writes of a package's entry points."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    lines = [f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in points.items()) for group, points in groups.items()]
    (info / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")


def installed(page: str, folder: Path, package: str) -> Path:
    """Write the package of a page as installed and return its folder."""
    told = tomllib.loads((written(page, folder) / "pyproject.toml").read_text(encoding="utf-8"))
    assert told["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"] == [package]
    made_known(folder, package, told["project"]["entry-points"])
    return folder


def python(site: Path, place: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder with what is installed in another."""
    paths = os.pathsep.join(filter(None, (str(site), os.environ.get("PYTHONPATH"))))
    command = [sys.executable, *words]
    environment = os.environ | {"PYTHONPATH": paths}
    return subprocess.run(command, cwd=place, env=environment, capture_output=True, text=True, check=False, timeout=280)


def bender(site: Path, place: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run `bender` there."""
    return python(site, place, "-m", "bender_cli", *words)
