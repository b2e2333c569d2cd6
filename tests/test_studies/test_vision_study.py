"""`bender benchmark vision`: it counts what it says, and its pictures are the same for the same seed."""

import json
from pathlib import Path

import pytest
from few import few

from bender_cli.main import main
from bender_studies.vision.accuracy import measure_case
from bender_studies.vision.cases import CASES
from bender_studies.vision.scale import SCALE_CASES, measure_scale

pytest.importorskip("cv2", reason="needs the extra bench")


@pytest.mark.parametrize("name", few(CASES, 0, 6))
def test_case_is_within_its_limit(name: str):
    errors = measure_case(CASES[name], "line", 30, 3)
    assert errors.found + errors.lost == 30
    assert errors.found >= 25
    assert errors.rms_px <= CASES[name].limit_px
    assert errors.far_off == 0


def test_line_beats_the_extreme_point_by_far():
    line, extreme = (measure_case(CASES["clean"], method, 30, 3) for method in ("line", "extreme"))
    assert 20.0 * line.rms_px < extreme.rms_px


@pytest.mark.parametrize("name", few(["1.5 um/px", "distortion -3 %"], 0))
def test_scale_is_within_its_limit(name: str):
    errors = measure_scale(SCALE_CASES[name], 1, 5)
    assert errors.max_percent <= 0.05
    assert errors.claimed_percent < 0.05


@pytest.mark.slow
def test_command_writes_what_it_prints(tmp_path: Path, capsys):
    words = ["--frames", "2", "--rulers", "1", "--out", str(tmp_path)]
    assert main(["benchmark", "vision", *words]) == 0
    said = capsys.readouterr().out
    facts = json.loads((tmp_path / "vision.json").read_text(encoding="utf-8"))
    assert set(facts["tip"]) == set(CASES)
    assert set(facts["scale"]) == set(SCALE_CASES)
    assert all(name in said for name in CASES)
