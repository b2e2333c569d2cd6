"""The picture and the figures of the page on `bender demo` are those of today's `bender tune --model bench`."""

import json
import re
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from bender_cli.main import main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "reference" / "figures" / "demo.md").read_text(encoding="utf-8")
PICTURE = ROOT / "docs" / "step-response.png"
DIFFERENT_PIXELS = 5e-4
"""Share of pixels that another processor or version of a font may draw otherwise."""


def _rows(page: str, named: str) -> list[float]:
    """Return rise time, settling time, overshoot and worst Ms of the first row of a table that starts with this."""
    row = re.search(rf"^\| {re.escape(named)}[^|]*\|(.*)\|$", page, re.MULTILINE)
    assert row is not None, named
    return [float(cell) for cell in row[1].split("|")[:4]]


@pytest.mark.slow
def test_picture_and_figures_are_todays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tune", "--model", "bench", "--out", str(tmp_path)]) == 0
    capsys.readouterr()
    told = json.loads((tmp_path / "tuning.json").read_text(encoding="utf-8"))
    others = {other["method"]: other for other in told["others"]}
    for named, row in (("ours: beetle antennae search", told["best"]), ("SIMC", others["simc"])):
        step, peak = row["step"], row["robustness"]["worst_sensitivity_peak"]
        found = [step["rise_time_s"], step["settling_time_s"], step["overshoot_percent"], peak]
        assert found == pytest.approx(_rows(PAGE, named), abs=0.006)
    shown, drawn = matplotlib.image.imread(PICTURE), matplotlib.image.imread(tmp_path / "step.png")
    assert shown.shape == drawn.shape, "draw it again: make picture"
    changed = np.abs(shown - drawn).max(axis=2) > 0.25
    assert changed.mean() < DIFFERENT_PIXELS, "draw it again: make picture"
