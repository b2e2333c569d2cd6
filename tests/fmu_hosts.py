"""Importers and checkers at hand; each importer in a process of its own, by the scripts in `test_export/importers`."""

import ctypes
import importlib.util
import json
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]
from numpy.typing import ArrayLike

from bender_loop.fmu.check.archive import archive_findings
from bender_loop.fmu.check.description import description_findings, model_identifiers
from bender_loop.fmu.check.standard import fmpy_findings, schema_findings

SCRIPTS = Path(__file__).parent / "test_export" / "importers"
WITHIN_M = 1e-12
SSP_SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"


def _without(package: str) -> str:
    """Say why an importer cannot be used here; an empty text where it can."""
    if find_spec(package) is None:
        return f"{package} is not installed; it has binaries for x86-64 only"
    if package == "ecospy" and sys.platform == "linux":
        try:
            ctypes.CDLL("libtbb.so.12")
        except OSError:
            return "ecospy needs libtbb.so.12; on Debian: apt-get install libtbb12"
    return ""


IMPORTERS = [
    pytest.param(script, marks=pytest.mark.skipif(bool(_without(package)), reason=_without(package) or "-"))
    for script, package in (
        ("in_cosim.py", "libcosimpy"),
        ("in_ecos.py", "ecospy"),
        ("in_container.py", "fmu_manipulation_toolbox"),
    )
]


def hosted(script: str, job: dict[str, Any], folder: Path) -> list[float]:
    """Run a job in an importer; returns the displacements in m that it wrote."""
    (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
    words = [sys.executable, str(SCRIPTS / script), str(folder / "job.json"), str(folder / "found.json")]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=120, cwd=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads((folder / "found.json").read_text(encoding="utf-8"))


def loaded(script: Path) -> ModuleType:
    """Return a script as a module."""
    spec = importlib.util.spec_from_file_location(script.stem, script)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def stepped_in_child(fmus: Sequence[Path], steps: Sequence[tuple[float, float]]) -> list[list[list[float]]]:
    """Step FMUs side by side through FMPy in a child process: [fmu][step][output]."""
    job = json.dumps({"fmus": [str(path) for path in fmus], "steps": list(steps)})
    script = SCRIPTS.parent / "running_fmu.py"
    done = subprocess.run(
        [sys.executable, str(script)], input=job, capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def largest_difference(left: ArrayLike, right: ArrayLike) -> float:
    one, other = np.asarray(left), np.asarray(right)
    assert one.shape == other.shape
    return float(np.max(np.abs(one - other)))


# fmutool reports errors in its log and by its exit status; the first of them ends the script
FMUTOOL = """
import sys
from fmu_manipulation_toolbox.cli.fmutool import fmutool
for path in sys.argv[1:]:
    sys.argv = ["fmutool", "-input", path, "-check"]
    fmutool()
print("all checked")
"""


def assert_no_check_finds_anything(path: Path) -> None:
    """Archive, schema, fmpy and the rules that checkers know."""
    with zipfile.ZipFile(path) as archive:
        text = archive.read("modelDescription.xml")
        root = ElementTree.fromstring(text)
        assert list(archive_findings(archive, model_identifiers(root))) == []
    assert list(schema_findings("2.0", text)) == []
    assert list(fmpy_findings(path)) == []
    assert list(description_findings(root)) == []


def assert_fmutool_finds_nothing(paths: Sequence[Path]) -> None:
    pytest.importorskip("fmu_manipulation_toolbox", reason="fmutool is not installed")
    words = [sys.executable, "-c", FMUTOOL, *map(str, paths)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.endswith("all checked\n")
    assert "ERROR" not in done.stdout + done.stderr


LOOP_IN_FMPY = """
import json, sys
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssv
archive, steps, step_s, shown, values = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), sys.argv[4], sys.argv[5:]
bound = read_ssv(values[0]) if values else None
found = simulate_ssp(archive, stop_time=(steps - 0.5) * step_s, step_size=step_s, parameter_set=bound)
print(json.dumps(found["plant." + shown].tolist()))
"""


def looped_in_fmpy(
    archive: Path, steps: int, step_s: float, shown: str = "displacement", values: Path | None = None
) -> list[float]:
    """Run the SSP archive of a loop in FMPy, with a file of values or as it is; returns what the plant shows in m."""
    words = [str(archive), str(steps), str(step_s), shown, *([] if values is None else [str(values)])]
    command = [sys.executable, "-c", LOOP_IN_FMPY, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    return json.loads(done.stdout)


def assert_follows_its_schemas(archive: Path) -> None:
    """The system structures and parameter values of an SSP archive, two of each."""
    with zipfile.ZipFile(archive) as opened:
        for ending, schema in ((".ssd", "Description"), (".ssv", "ParameterValues")):
            rules = etree.XMLSchema(etree.parse(SSP_SCHEMAS / f"SystemStructure{schema}.xsd"))
            texts = [opened.read(name) for name in opened.namelist() if name.endswith(ending)]
            assert len(texts) == 2
            for text in texts:
                rules.assertValid(etree.fromstring(text))
