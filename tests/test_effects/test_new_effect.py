"""An effect is added in a copy of the sources, as CONTRIBUTING.md says it, and a record is diagnosed with it."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from reported_diagnosis import record_of

from bender_loop.records.record import Record

ROOT = Path(__file__).parents[2]
ROOMS = (
    "plant_src", "compiled", "export", "loop", "report", "tuner", "identify", "effects", "inference", "discrepancy",
    "proving", "cli",
)  # fmt: skip
CEILING_um = 15.0

# what a person writes: a sensor whose reading goes no higher than a ceiling
BLOCK = {
    'size_um: float = parameter(0.0, unit="um", text="TODO", tunable=True)': (
        'ceiling_um: float = parameter(1e9, unit="um", low=0.0, text="highest reading", tunable=True)'
    ),
    "Neutral at zero.": "The highest reading.",
    "(settings.size_um,)": "(settings.ceiling_um,)",
    "    del size_um\n    return y\n": "    return min(y, size_um)\n",
}
LIBRARY = {
    'COVERED = {"size_um": (0.1, 10.0)}': 'COVERED = {"ceiling_um": (2.0, 20.0)}',
    'sizes.sized(amplitude("size_um", 0.1, 20.0), COVERED["size_um"], "um")': (
        'scale("ceiling_um", 0.1 * sizes.stroke_um, sizes.stroke_um, 12)'
    ),
    ", size),)": ", size, timed=False),)",
    "import Form, amplitude, simple": "import Form, scale, simple",
    '{"size_um": (0.0, 1.0, "TODO: where that comes from")}': '{"ceiling_um": (1.0, 1e5, "the range of the sensor")}',
    'example={"size_um": 1.0}': 'example={"ceiling_um": 15.0}',
}
EXAMPLE = {
    '[{"size_um": 1.0}]': '[{"ceiling_um": 15.0}]',
    "    raise NotImplementedError\n": '    return np.minimum(plain_um, parameters["ceiling_um"])\n',
}


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("copy")
    skipped = shutil.ignore_patterns("__pycache__", "*.fmu")
    for name in (*ROOMS, "docs/effects", "tests/effect_examples", "tests/test_plant"):
        shutil.copytree(ROOT / name, root / name, ignore=skipped)
    for name in ("chain_oracle.py", "few.py", "plant_runs.py"):
        shutil.copy(ROOT / "tests" / name, root / "tests" / name)
    shutil.copy(ROOT / "pyproject.toml", root)
    return root


def in_copy(root: Path, *words: str) -> str:
    paths = os.pathsep.join(str(root / name) for name in (*ROOMS, "tests"))
    done = subprocess.run(
        [sys.executable, *words], cwd=root, env=os.environ | {"PYTHONPATH": paths},
        capture_output=True, text=True, check=False, timeout=240,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def fill_in(path: Path, what: dict[str, str]) -> None:
    text = path.read_text(encoding="utf-8")
    for found, written in what.items():
        assert found in text, f"{path.name}: no {found!r}"
        text = text.replace(found, written)
    path.write_text(text, encoding="utf-8")


def write(record: Record, path: Path) -> None:
    rows = zip(record.time_s, record.voltage_V, record.displacement_um, strict=True)
    text = "time_s,voltage_V,displacement_um\n" + "".join(f"{t:.6f},{v:.6f},{d:.6f}\n" for t, v, d in rows)
    path.write_text(text, encoding="utf-8")


@pytest.mark.slow
def test_an_effect_is_added_with_five_files_and_named(copy: Path):
    before = {path: path.read_bytes() for path in copy.rglob("*") if path.is_file()}
    in_copy(copy, "-m", "bender_cli", "effects", "new", "reading_ceiling", "--stage", "sensor")
    fill_in(copy / "plant_src/bender_plant/blocks/reading_ceiling.py", BLOCK)
    fill_in(copy / "effects/bender_effects/library/reading_ceiling.py", LIBRARY)
    fill_in(copy / "tests/effect_examples/reading_ceiling.py", EXAMPLE)
    changed = {
        path.relative_to(copy).as_posix()
        for path in copy.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and before.get(path) != path.read_bytes()
    }
    assert changed == {
        "plant_src/bender_plant/blocks/__init__.py",
        "plant_src/bender_plant/blocks/reading_ceiling.py",
        "effects/bender_effects/library/reading_ceiling.py",
        "tests/effect_examples/reading_ceiling.py",
        "docs/effects/reading_ceiling.md",
    }

    told = in_copy(copy, "-m", "bender_cli", "effects", "--write-docs").splitlines()
    written = ("docs/effects/reading_ceiling.md", "docs/effects/index.md", "plant_src/README.md")
    assert sorted(told) == sorted(f"written: {copy / name}" for name in written)
    assert "`reading_ceiling`" in (copy / "plant_src/README.md").read_text(encoding="utf-8")
    assert in_copy(copy, "-m", "bender_cli", "effects", "--write-docs").startswith("the documentation is as")

    tests = ("-m", "pytest", "-q", "-n", "0", "-p", "no:randomly", "-p", "no:cacheprovider")
    out = in_copy(copy, *tests, "tests/test_plant/test_effects.py", "-k", "reading_ceiling")
    assert " passed" in out

    record = record_of()
    noise_um = 0.06 * np.random.default_rng(3).standard_normal(record.time_s.size)
    capped = np.minimum(record_of(seed=7).displacement_um, CEILING_um) + noise_um
    write(Record(record.time_s, record.voltage_V, capped), copy / "record.csv")
    in_copy(copy, "-m", "bender_cli", "diagnose", "record.csv", "--out", "found")
    found = json.loads((copy / "found/diagnosis.json").read_text(encoding="utf-8"))
    assert (found["verdict"], [x["id"] for x in found["effects"]]) == ("named", ["reading_ceiling"])
    number = found["effects"][0]["parameters"]["ceiling_um"]
    assert number["value"] == pytest.approx(CEILING_um, abs=0.1)
    assert number["unit"] == "um"
