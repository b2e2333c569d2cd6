"""An FMU that was opened and closed in a process must not stand in the way of the next one that is built there."""

import subprocess
import sys
from pathlib import Path

import pytest

CHILD = """
import sys
from pathlib import Path
from bender_export.build import build_plant_fmu, ensure_plant_fmu
from bender_loop.fmu.plant import FmuPlant
from bender_plant.model import load_model

folder = Path(sys.argv[1])
first = build_plant_fmu(load_model("paper"), folder / "first.fmu")
with FmuPlant(first) as plant:
    before = plant.step(10.0, 0.01)
again = build_plant_fmu(load_model("paper"), folder / "again.fmu")
assert again.read_bytes() == first.read_bytes()
second = build_plant_fmu(load_model("paper").with_values({"calibration.gain": 2.0}), folder / "second.fmu")
with FmuPlant(second) as plant:
    assert abs(plant.step(10.0, 0.01) - 2.0 * before) < 1e-9
ensure_plant_fmu("paper")
print("built")
"""


@pytest.mark.slow
def test_fmus_can_be_built_after_one_was_opened(tmp_path: Path) -> None:
    words = [sys.executable, "-W", "error", "-c", CHILD, str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "built"
