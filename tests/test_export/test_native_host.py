"""A host that is not Python, with an interpreter and not one package: it runs, and it ends well every time."""

import ctypes.util
import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import fmpy
import pytest
from few import few
from foreign_fmus import HEADERS, SOURCES, c_compiler, needs_compiler
from plant_runs import kernel_outputs_m

from bender_export.build import plant_fmu
from bender_plant.model import load_model

RUNS, STEPS, STEP_S, VOLTAGE_V = 10, 50, 0.01, 20.0


def python_library() -> Path | None:
    """Return the shared library of this interpreter, None where it was built without one."""
    name = sysconfig.get_config_var("INSTSONAME") or ""
    for folder in (sysconfig.get_config_var("LIBDIR"), "/usr/lib/x86_64-linux-gnu", "/usr/lib64"):
        if folder and ".so" in name and (Path(folder) / name).is_file():
            return Path(folder) / name
    other = ctypes.util.find_library(f"python{sys.version_info.major}.{sys.version_info.minor}")
    return None if other is None else Path(other)


pytestmark = [
    needs_compiler,
    pytest.mark.skipif(sys.platform != "linux", reason="LD_PRELOAD is for Linux"),
    pytest.mark.skipif(
        python_library() is None, reason="this Python has no shared library; on Debian: apt-get install libpython3.11"
    ),
]


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = c_compiler()
    assert compiler is not None
    out = tmp_path_factory.mktemp("host") / "host"
    words = [compiler, "-std=gnu99", "-O1", "-Wall", f"-I{HEADERS}", str(SOURCES / "host.c"), "-o", str(out), "-ldl"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture(scope="module")
def bare_python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Python home with the standard library and without any site-packages."""
    home = tmp_path_factory.mktemp("bare")
    standard = Path(sysconfig.get_path("stdlib"))
    folder = home / "lib" / standard.name
    folder.mkdir(parents=True)
    for item in standard.iterdir():
        if item.name not in ("site-packages", "dist-packages", "sitecustomize.py"):
            (folder / item.name).symlink_to(item)
    return home


def in_host(host: Path, home: Path, fmu: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    description = fmpy.read_model_description(str(fmu))
    assert description.coSimulation is not None
    if not folder.exists():
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)
    library = folder / "binaries" / fmpy.platform / f"{description.coSimulation.modelIdentifier}.so"
    words = [str(host), str(library), (folder / "resources").as_uri(), description.guid]
    environment = {"LD_PRELOAD": str(python_library()), "PYTHONHOME": str(home), "PATH": os.defpath}
    return subprocess.run(
        [*words, str(STEPS), str(STEP_S), str(VOLTAGE_V)],
        env=environment, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip


@pytest.mark.parametrize("name", few(["paper", "bench"], 0))
def test_it_runs_and_ends_with_status_0_ten_times_out_of_ten(
    host: Path, bare_python: Path, tmp_path: Path, name: str
) -> None:
    model = load_model(name)
    (tmp_path / "plant.fmu").write_bytes(plant_fmu(model))
    expected_m = [reading for reading, _ in kernel_outputs_m(model, [(VOLTAGE_V, STEP_S)] * STEPS)]
    for _ in range(RUNS):
        done = in_host(host, bare_python, tmp_path / "plant.fmu", tmp_path / "unpacked")
        assert (done.returncode, done.stderr) == (0, "")
        found = [float(line) for line in done.stdout.splitlines()]
        assert found == pytest.approx(expected_m, abs=1e-12)
