"""C compilers: `ziglang` for every platform where it is installed, else the machine's own for the machine's own."""

import contextlib
import hashlib
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bender_loop.errors import InputError, RunError
from bender_loop.shell.cache import cache_folder
from bender_loop.shell.extras import install_command
from bender_loop.shell.files import prepare_directory, write_atomically
from bender_loop.shell.run import doing

# small is as fast here as quick: a step is a few calls of libm
FLAGS = ("-std=c99", "-Os", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden", "-shared", "-w")
_TIMEOUT_S = 1200.0
"""Of one compilation: on a busy machine ziglang takes minutes for its C library."""
LIBRARIES, MOST_LIBRARIES = "libraries", 300
"""Where the cache keeps what was compiled, and how many files of it, the newest."""


@dataclass(frozen=True, slots=True)
class Platform:
    """A platform that an FMU can carry a library for.

    Attributes:
        name: what people type.
        fmi2: folder of FMI 2.0 under `binaries/`.
        fmi3: folder of FMI 3.0, by the tuple.
        ending: of a library.
        target: what zig calls it.
    """

    name: str
    fmi2: str
    fmi3: str
    ending: str
    target: str


PLATFORMS: tuple[Platform, ...] = (
    Platform("linux64", "linux64", "x86_64-linux", ".so", "x86_64-linux-gnu.2.17"),
    Platform("win64", "win64", "x86_64-windows", ".dll", "x86_64-windows-gnu"),
    Platform("aarch64-linux", "aarch64-linux", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
    Platform("aarch64-darwin", "aarch64-darwin", "aarch64-darwin", ".dylib", "aarch64-macos"),
    Platform("darwin64", "darwin64", "x86_64-darwin", ".dylib", "x86_64-macos"),
)
"""What one FMU can carry libraries for."""


def own_platform() -> Platform | None:
    """Return the platform of this machine, None where there is no name for it."""
    arm = platform.machine().lower() in ("aarch64", "arm64")
    names = {
        "Linux": "aarch64-linux" if arm else "linux64",
        "Windows": "" if arm else "win64",
        "Darwin": "aarch64-darwin" if arm else "darwin64",
    }
    if sys.maxsize < 2**32:
        return None
    return next((x for x in PLATFORMS if x.name == names.get(platform.system())), None)


def has_zig() -> bool:
    """Return whether the package ziglang is installed."""
    return importlib.util.find_spec("ziglang") is not None


def own_compiler() -> str | None:
    """Return the machine's own C compiler, None where there is none."""
    return os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


def chosen(names: Sequence[str] | None) -> tuple[tuple[Platform, ...], str | None]:
    """Return the platforms to compile for, and why there are none or fewer than could be.

    Args:
        names: of platforms, `all` for every one; None for what the compiler at hand can do.

    Raises:
        InputError: a name is no platform, or there is no compiler for it.
    """
    own = own_platform()
    if names is None:
        if has_zig():
            return PLATFORMS, None
        if own_compiler() is not None and own is not None:
            return (
                own,
            ), f"compiled for {own.name} only: {install_command('native')} brings a compiler for every platform"
        return (), (
            "found no C compiler: the FMU carries its sources only; any cc compiles it, or that of "
            f"{install_command('native')}"
        )
    wanted: list[Platform] = []
    for name in names:
        found = [x for x in PLATFORMS if name in ("all", x.name)]
        if not found and name != "none":
            known = ", ".join(x.name for x in PLATFORMS)
            raise InputError(f"--platforms: found {name!r}, expected all, none or some of {known}")
        wanted += [x for x in found if x not in wanted]
    for one in wanted:
        if not has_zig() and (one != own or own_compiler() is None):
            raise InputError(
                f"--platforms: found no compiler for {one.name}, expected one: {install_command('native')}"
            )
    return tuple(wanted), None


def compiled(
    files: Mapping[str, bytes], name: str, target: Platform, more: Sequence[str] = (), own: bool = False
) -> bytes:
    """Return the shared library of C sources for a platform, from the cache where they were compiled before.

    Args:
        files: sources and headers by name.
        name: of the library, without its ending.
        target: the platform.
        more: further flags.
        own: prefer the machine's own compiler to ziglang for the machine's own platform.

    Raises:
        RunError: the compiler failed.
    """
    compiler = compiler_words(target, own)
    kept = cache_folder() / LIBRARIES / f"{name}-{_key(files, name, target, more, compiler)}{target.ending}"
    with contextlib.suppress(OSError):
        return kept.read_bytes()
    library = _compiled(files, name, target, [*compiler, *FLAGS], more)
    with contextlib.suppress(InputError, OSError):  # a cache that cannot be written: compiled again the next time
        write_atomically(prepare_directory(kept.parent) / kept.name, library)
        for old in sorted(kept.parent.iterdir(), key=lambda path: path.stat().st_mtime)[:-MOST_LIBRARIES]:
            old.unlink()
    return library


def _key(files: Mapping[str, bytes], name: str, target: Platform, more: Sequence[str], compiler: Sequence[str]) -> str:
    """Return what a library depends on, as a hash: sources, words, and which compiler that is."""
    program = Path(shutil.which(compiler[0]) or compiler[0]).resolve()
    built = program.stat().st_mtime_ns if program.exists() else 0
    zig = importlib.metadata.version("ziglang") if "ziglang" in compiler else ""
    words = [name, target.name, *compiler, str(program), str(built), zig, *FLAGS, *more]
    hasher = hashlib.sha256("\0".join(words).encode())
    for file in sorted(files):
        hasher.update(file.encode() + b"\0" + hashlib.sha256(files[file]).digest())
    return hasher.hexdigest()[:24]


def _compiled(
    files: Mapping[str, bytes], name: str, target: Platform, compiler: Sequence[str], more: Sequence[str]
) -> bytes:
    doing(f"compiling {name} for {target.name} with {Path(compiler[0]).name}")
    with tempfile.TemporaryDirectory(prefix="bender_native_") as folder:
        place = Path(folder)
        for file, data in files.items():
            (place / file).write_bytes(data)
        out = place / f"{name}{target.ending}"
        sources = sorted(file for file in files if file.endswith(".c"))
        pic = [] if target.ending == ".dll" else ["-fPIC", "-fno-unwind-tables", "-fno-asynchronous-unwind-tables"]
        # the same bytes wherever it is compiled
        words = [*compiler, *pic, *more, f"-ffile-prefix-map={folder}=.", *sources, "-o", out.name]
        words += [] if target.ending == ".dll" else ["-lm"]
        words += ["-s"] if target.ending != ".dylib" else ["-Wl,-S", f"-Wl,-install_name,@rpath/{out.name}"]
        environment = os.environ | {"SOURCE_DATE_EPOCH": "315532800"}
        try:
            done = subprocess.run(
                words, cwd=place, capture_output=True, text=True, check=False, timeout=_TIMEOUT_S, env=environment
            )
        except (OSError, subprocess.TimeoutExpired) as problem:
            raise RunError(f"{words[0]}: {problem}") from None
        if done.returncode != 0 or not out.is_file():
            line = (done.stderr.strip().splitlines() or ["no message"])[0]
            raise RunError(f"{words[0]}: status {done.returncode} for {target.name}: {line}")
        return out.read_bytes()


def universal(libraries: Mapping[str, bytes]) -> bytes:
    """Return a universal library of macOS.

    Args:
        libraries: Mach-O libraries by the name of their platform, `darwin64` and `aarch64-darwin`.
    """
    kinds = {"darwin64": (0x01000007, 3), "aarch64-darwin": (0x0100000C, 0)}
    align = 14
    place = 1 << align
    header, body = struct.pack(">II", 0xCAFEBABE, len(libraries)), b""
    for name, data in sorted(libraries.items()):
        cpu, kind = kinds[name]
        header += struct.pack(">IIIII", cpu, kind, place + len(body), len(data), align)
        body += data + bytes(-len(data) % (1 << align))
    return header + bytes(place - len(header)) + body


def compiler_words(target: Platform, prefer_own: bool) -> list[str]:
    """Return how a compiler for a platform is called.

    Raises:
        RunError: there is none.
    """
    own = own_compiler()
    if has_zig() and not (prefer_own and own is not None and target == own_platform()):
        return [sys.executable, "-P", "-m", "ziglang", "cc", "-target", target.target]
    if own is None:
        raise RunError(f"found no C compiler, expected one: {install_command('native')}")
    return [own]


__all__ = [
    "FLAGS",
    "PLATFORMS",
    "Platform",
    "chosen",
    "compiled",
    "compiler_words",
    "has_zig",
    "own_compiler",
    "own_platform",
    "universal",
]
