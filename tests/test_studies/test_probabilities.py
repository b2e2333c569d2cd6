"""How well probabilities are kept, and what judged effects teach about their weights."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_cli.main import main
from bender_studies.hidden_effects.probabilities import (
    JudgedEffect,
    by,
    calibration_error,
    reliability,
    weights,
)

TRUE_WEIGHTS = (-2.0, 1.0, 0.5, 1.0, 0.5)


def drawn(count: int, seed: int) -> list[JudgedEffect]:
    """Effects that are there as often as a logistic curve of their cases says."""
    rng = np.random.default_rng(seed)
    cases = np.column_stack([np.ones(count), rng.integers(0, 2, count), rng.uniform(0.0, [8.0, 4.0, 1.0], (count, 3))])
    probabilities = 1.0 / (1.0 + np.exp(-cases @ np.array(TRUE_WEIGHTS)))
    there = rng.random(count) < probabilities
    return [JudgedEffect(tuple(map(float, x)), bool(y)) for x, y in zip(cases, there, strict=True)]


def test_weights_are_found_again():
    assert weights(drawn(20_000, 1)) == pytest.approx(TRUE_WEIGHTS, abs=0.15)


def test_more_evidence_never_speaks_against_an_effect():
    upside_down = [JudgedEffect(x.parts, not x.is_there) for x in drawn(500, 2)]
    found = weights(upside_down)[1:]
    assert min(found) >= 0.0
    assert found[:3] == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


def test_the_weights_that_drew_effects_give_back_their_probabilities():
    told = drawn(50, 3)
    evidence = np.array([x.parts for x in told]) @ np.array(TRUE_WEIGHTS)
    assert [math.log(p / (1.0 - p)) for p, _ in by(told, TRUE_WEIGHTS)] == pytest.approx(list(evidence))
    assert [x for _, x in by(told, TRUE_WEIGHTS)] == [x.is_there for x in told]


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.booleans()), max_size=40))
def test_every_effect_is_in_one_bin_and_no_error_is_beyond_one(pairs: list[tuple[float, bool]]):
    assert sum(int(row[1]) for row in reliability(pairs)) == len(pairs)
    assert 0.0 <= calibration_error(pairs) <= 1.0


def test_what_is_off_is_weighed_by_how_many_it_holds():
    kept = [(0.5, x) for x in (True, False)] * 3
    off = [(0.9, x) for x in (True, False)]
    assert calibration_error(kept) == pytest.approx(0.0)
    assert calibration_error(off) == pytest.approx(0.4)
    assert calibration_error(kept + off) == pytest.approx(0.1)
    assert reliability(kept + off) == [["0.4 to 0.6", "6", "0.500", "0.500"], ["0.8 to 1.0", "2", "0.900", "0.500"]]


def written(folder: Path, devices: int) -> Path:
    """Results of both benchmarks, as they write them: of rivals and what is read off nothing is taught."""
    folder.mkdir()
    names = "deviations", "log_ratio", "closed"
    tried = []
    for x in drawn(devices, 4):
        weighed = dict(zip(names, x.parts[2:], strict=True)) | {"passed": bool(x.parts[1])}
        own = {"id": "creep", "weighed": weighed, "is_there": x.is_there}
        tried.append({"told": [own, {"id": "fold", "weighed": None, "is_there": False}]})
    (folder / "devices.json").write_text(json.dumps({"tried": tried}), encoding="utf-8")
    told = {"creep": {"case": [1.0, 1.0, 8.0, 4.0, 1.0]}, "fold": {"case": [1.0, 0.0, 0.0, 0.0, 0.1]}}
    benches = [{"hidden": ["creep"], "told": told}, {"hidden": ["backlash"], "told": {}}] * 3
    (folder / "discrepancy.json").write_text(json.dumps({"cases": benches}), encoding="utf-8")
    return folder


def test_weights_are_taught_by_results_of_both_benchmarks(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    results, out = written(tmp_path / "results", 4000), tmp_path / "out"
    assert main(["benchmark", "probabilities", str(results), "--out", str(out), "--quiet"]) == 0
    found = json.loads((out / "probabilities.json").read_text(encoding="utf-8"))
    assert [(x["cases of"], x["cases"], x["effects"]) for x in found["errors"]] == [
        ("drawn devices", 4000, 4000), ("hidden benches", 3, 6), ("all", 4003, 4006),
    ]  # fmt: skip
    assert found["errors"][2]["error by weights of every second"] < 0.03
    assert found["weights_of_all"][2:4] == pytest.approx(TRUE_WEIGHTS[2:4], abs=0.3)
    assert "Expected calibration error" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "found no devices.json"), ("{", "found no result"), ('{"tried": [{}]}', "found no result"),
     ('{"tried": []}', "found effects in 0 cases")],
)  # fmt: skip
def test_what_is_no_result_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str | None, said: str
):
    if content is not None:
        (tmp_path / "devices.json").write_text(content, encoding="utf-8")
    out = tmp_path / "out"
    assert main(["benchmark", "probabilities", str(tmp_path), "--out", str(out)]) == 2
    assert said in capsys.readouterr().err
    assert not out.exists()
