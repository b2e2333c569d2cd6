"""One file for five platforms: run here, under qemu and under Wine, and where there is no Python at all."""

import io
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import pytest
from foreign_fmus import HEADERS, SOURCES, c_compiler, needs_compiler
from plant_runs import kernel_outputs_m

from bender_loop.fmu.check.archive import archive_findings
from bender_native.build import Way, build_native, native_plant_fmu, way
from bender_native.compilers import PLATFORMS, has_zig, own_platform
from bender_plant.model import load_model

STEPS, STEP_S, VOLTAGE_V = 80, 0.01, 20.0
WITHIN_M = 1e-15
MOST_BYTES = 200_000
ARM_ROOT = Path("/usr/aarch64-linux-gnu")
WINE = next(
    (x for x in (shutil.which("wine64"), shutil.which("wine"), "/usr/lib/wine/wine64") if x and Path(x).exists()), None
)

on_linux = pytest.mark.skipif(sys.platform != "linux", reason="qemu, Wine and chroot are tried on Linux")
needs_zig = pytest.mark.skipif(not has_zig(), reason="ziglang is not installed")
needs_arm = pytest.mark.skipif(
    shutil.which("qemu-aarch64") is None or not (ARM_ROOT / "lib" / "ld-linux-aarch64.so.1").exists(),
    reason="no qemu-aarch64 with a C library for it; on Debian: apt-get install qemu-user libc6-arm64-cross",
)
needs_wine = pytest.mark.skipif(WINE is None, reason="Wine is not installed; on Debian: apt-get install wine64")


def expected_m() -> list[float]:
    return [reading for reading, _ in kernel_outputs_m(load_model("paper"), [(VOLTAGE_V, STEP_S)] * STEPS)]


def agree(done: subprocess.CompletedProcess[str]) -> None:
    assert done.returncode == 0, done.stderr
    found = [float(line) for line in done.stdout.split()]
    assert max(found) > 1e-6
    assert max(abs(a - b) for a, b in zip(found, expected_m(), strict=True)) <= WITHIN_M


@pytest.fixture(scope="module")
def five(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU for all platforms, and beside it what is in it."""
    folder = tmp_path_factory.mktemp("five")
    path = folder / "five.fmu"
    path.write_bytes(native_plant_fmu(load_model("paper"), way(2, ["all"])))
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder / "unpacked")
    return path


def words_of(five: Path, library: str) -> list[str]:
    unpacked = five.parent / "unpacked"
    guid = str(fmpy.read_model_description(str(five)).guid)
    return [
        str(unpacked / "binaries" / library), (unpacked / "resources").as_uri(), guid,
        str(STEPS), str(STEP_S), str(VOLTAGE_V),
    ]  # fmt: skip


def host_by_zig(folder: Path, target: str, ending: str = "") -> Path:
    out = folder / f"host{ending}"
    words = [sys.executable, "-m", "ziglang", "cc", "-target", target, f"-I{HEADERS}", str(SOURCES / "host.c")]
    done = subprocess.run([*words, "-o", str(out)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out


@pytest.mark.slow
@needs_zig
def test_five_platforms_fit_into_one_small_file(five: Path) -> None:
    assert five.stat().st_size < MOST_BYTES
    with zipfile.ZipFile(five) as archive:
        names = set(archive.namelist())
        assert list(archive_findings(archive, {"PiezoBender"})) == []
    assert {f"binaries/{x.fmi2}/PiezoBender{x.ending}" for x in PLATFORMS} <= names


@pytest.mark.slow
@on_linux
@needs_zig
@needs_arm
def test_on_arm_under_qemu(five: Path, tmp_path: Path) -> None:
    host = host_by_zig(tmp_path, "aarch64-linux-gnu.2.28")
    words = ["qemu-aarch64", "-L", str(ARM_ROOT), str(host), *words_of(five, "aarch64-linux/PiezoBender.so")]
    agree(subprocess.run(words, capture_output=True, text=True, check=False, timeout=120))


@pytest.mark.slow
@on_linux
@needs_zig
@needs_wine
def test_on_windows_under_wine(five: Path, tmp_path: Path) -> None:
    host = host_by_zig(tmp_path, "x86_64-windows-gnu", ".exe")
    environment = {**os.environ, "WINEPREFIX": str(tmp_path / "prefix"), "WINEDEBUG": "-all"}
    words = [str(WINE), str(host), *words_of(five, "win64/PiezoBender.dll")]
    agree(subprocess.run(words, capture_output=True, text=True, check=False, timeout=300, env=environment))


@pytest.mark.slow
@on_linux
@needs_compiler
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="a folder becomes the root for root only")
def test_where_there_is_no_python(tmp_path: Path) -> None:
    own = own_platform()
    assert own is not None
    fmu = tmp_path / "plant.fmu"
    fmu.write_bytes(native_plant_fmu(load_model("paper"), way(2, [own.name]), own=True))
    root = tmp_path / "root"
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(root / "fmu")
    words = [str(c_compiler()), "-std=gnu99", f"-I{HEADERS}", str(SOURCES / "host.c"), "-o", str(root / "host"), "-ldl"]
    assert subprocess.run(words, capture_output=True, text=True, check=False).returncode == 0
    binary = root / "fmu" / "binaries" / own.fmi2 / f"PiezoBender{own.ending}"
    needed = {line for each in (root / "host", binary) for line in shared_libraries(each)}
    assert {Path(x).name.split(".")[0] for x in needed} <= {
        "libc",
        "libm",
        "libdl",
        "ld-linux-x86-64",
        "ld-linux-aarch64",
    }
    for library in needed:
        (root / library.lstrip("/")).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(library, root / library.lstrip("/"))
        (root / library.lstrip("/")).chmod(0o755)
    assert not list(root.rglob("*python*"))
    guid = str(fmpy.read_model_description(str(fmu)).guid)
    inside = [f"/fmu/binaries/{own.fmi2}/PiezoBender{own.ending}", "file:///fmu/resources", guid]
    words = [
        str(shutil.which("chroot", path="/usr/sbin:/usr/bin:/sbin:/bin")),
        str(root),
        "/host",
        *inside,
        str(STEPS),
        str(STEP_S),
        str(VOLTAGE_V),
    ]
    agree(subprocess.run(words, capture_output=True, text=True, check=False, timeout=60, env={}))


def shared_libraries(binary: Path) -> set[str]:
    """Return the paths of the libraries that a binary loads, the loader among them."""
    done = subprocess.run(["ldd", str(binary)], capture_output=True, text=True, check=True)
    return {word for line in done.stdout.splitlines() for word in line.split() if word.startswith("/")}


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_closed_loop_comes_with_fmus_of_either_version(fmi: int, tmp_path: Path) -> None:
    plant, controller, loop = build_native("beam", tmp_path / "PiezoBender.fmu", tmp_path, Way(fmi))
    assert (plant.name, controller.name, loop.name) == ("PiezoBender.fmu", "PidController.fmu", "ClosedLoop.ssp")
    with zipfile.ZipFile(loop) as archive:
        parts = [x for x in archive.namelist() if x.endswith(".fmu")]
        assert len(parts) == 3
        for part in parts:
            with zipfile.ZipFile(io.BytesIO(archive.read(part))) as inside:
                description = ElementTree.fromstring(inside.read("modelDescription.xml"))
            assert description.get("fmiVersion") == f"{fmi}.0"
