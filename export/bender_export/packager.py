"""PythonFMU's own part: library, base class and loader information around a slave script."""

import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import distribution
from importlib.metadata import files as distribution_files
from pathlib import Path

from bender_export.archive import unpacked
from bender_export.content import Content


def pythonfmu_entries(content: Content) -> dict[str, bytes]:
    """Return the entries of the archive that PythonFMU makes of a slave script and what it imports."""
    with (
        tempfile.TemporaryDirectory(prefix="bender_export_") as folder,
        _imports_undone(content.script),
        _installed_pythonfmu(),
    ):
        from pythonfmu import FmuBuilder

        sources, fmu = Path(folder) / "sources", Path(folder) / "made.fmu"
        for name, data in content.files.items():
            file = sources / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(data)
        script = sources / f"{content.script}.py"
        FmuBuilder.build_FMU(
            script,
            dest=fmu,
            project_files=[item for item in sources.iterdir() if item != script and item.name != "__pycache__"],
            needsExecutionTool=False,
            canGetAndSetFMUstate=True,
            canSerializeFMUstate=True,
        )
        return unpacked(fmu)


def pythonfmu_licence() -> bytes:
    """Return the licence under which PythonFMU's library and base class go into the archive."""
    for file in distribution_files("pythonfmu") or ():
        if file.name.startswith("LICENSE"):
            return file.read_binary()
    return b"PythonFMU: MIT licence, see https://github.com/NTNU-IHB/PythonFMU\n"


@contextmanager
def _installed_pythonfmu() -> Iterator[None]:
    """Have `pythonfmu` mean the installed one: an FMU that this process has opened leaves its own copy in the way."""
    path, loaded = sys.path[:], {name: module for name, module in sys.modules.copy().items() if _is_pythonfmu(name)}
    installed = Path(str(distribution("pythonfmu").locate_file("")))
    if all(
        Path(getattr(module, "__file__", None) or installed).is_relative_to(installed) for module in loaded.values()
    ):
        loaded = {}
    for name in loaded:
        del sys.modules[name]
    sys.path.insert(0, str(installed))
    try:
        yield
    finally:
        sys.path[:] = path
        for name in [name for name in sys.modules.copy() if loaded and _is_pythonfmu(name)]:
            del sys.modules[name]
        sys.modules.update(loaded)


def _is_pythonfmu(name: str) -> bool:
    return name == "pythonfmu" or name.startswith("pythonfmu.")


@contextmanager
def _imports_undone(script: str) -> Iterator[None]:
    """Take back what the builder imports: the same FMU may be loaded into this process later on, from its own files."""
    path, modules, digest = sys.path[:], set(sys.modules), script.rpartition("_")[2]
    try:
        yield
    finally:
        sys.path[:] = path
        for name in set(sys.modules) - modules:
            if name.partition(".")[0].endswith(digest):
                del sys.modules[name]
