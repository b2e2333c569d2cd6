"""`diagnosis.json` against its schema and its page, for every verdict, and for the sample record."""

import copy
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from few import few
from jsonschema import Draft202012Validator
from reported_diagnosis import hypothesis, levels, record_of, told

from bender_cli.main import main
from bender_discrepancy.conclusion.diagnosis_json import outcome
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.conclusion.measurement.gap import measure
from bender_discrepancy.conclusion.partial import partial_outcome
from bender_effects.catalogue import EFFECTS
from bender_inference.search.judgement.verdict import Word
from bender_inference.search.result import SearchResult
from bender_inference.witnesses.missing_columns import TEMPERATURE
from bender_inference.witnesses.read_back import ELECTRODES, SUPPLY
from bender_plant.model import load_model

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"
EXAMPLES = Path(__file__).parents[2] / "examples"
SCHEMA = json.loads((REFERENCE / "diagnosis.schema.json").read_text(encoding="utf-8"))
VALIDATOR = Draft202012Validator(SCHEMA)
LAG = {"source_resistance": {"time_constant_s": 0.03}}
VERDICTS = ("named", "no_gap", "recalibrated", "ambiguous", "unexplained")


def _diagnosis(verdict: Word) -> SearchResult:
    base = load_model("paper")
    if verdict == "no_gap":
        return told([record_of()], word=verdict)
    if verdict == "recalibrated":
        records = [record_of(gain=0.8, offset_um=1.0), record_of(gain=0.8, voltage_V=levels(seed=3), seed=8)]
        return told(records, word=verdict)
    if verdict == "unexplained":
        return told([record_of(effects=LAG)], word=verdict)
    # one sine cannot tell on which side of the plant a lag is
    sine_V = 25.0 - 25.0 * np.cos(2.0 * np.pi * 0.5 * np.arange(600) / 30.0)
    record = record_of(effects=LAG, voltage_V=sine_V if verdict == "ambiguous" else None)
    best, rival = (hypothesis(base, [record], (name, (0.03,))) for name in ("source_resistance", "sensor_lag"))
    return told([record], best, [rival], word=verdict)


@pytest.fixture(scope="module", params=VERDICTS)
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The file of a diagnosis with this verdict, as a program reads it."""
    findings = find(_diagnosis(request.param))
    fmu = tmp_path_factory.mktemp("diagnosis") / "model.fmu"
    measured = measure(findings.search, findings.model, findings.calibration, fmu, findings.of_record)
    return json.loads(json.dumps(outcome(findings, measured), allow_nan=False))


def test_the_schema_is_one() -> None:
    Draft202012Validator.check_schema(SCHEMA)


def assert_valid(result: dict[str, Any]) -> None:
    assert [error.message for error in VALIDATOR.iter_errors(result)] == []
    assert set(result) <= set(SCHEMA["properties"])


def test_what_is_written_is_valid(written: dict[str, Any]) -> None:
    assert_valid(written)


@pytest.mark.parametrize("searched", [True, False])
def test_what_an_interrupt_leaves_is_valid(searched: bool) -> None:
    result = json.loads(json.dumps(partial_outcome(_diagnosis("ambiguous"), ["record.csv"], searched), allow_nan=False))
    assert_valid(result)
    assert (result["partial"], result["fmu"]) == (True, None)


def test_every_key_is_in_the_schema_and_every_one_of_the_schema_on_the_page(written: dict[str, Any]) -> None:
    assert set(written) <= set(SCHEMA["properties"])
    of_effects = set(SCHEMA["$defs"]["effect"]["properties"])
    assert all(set(effect) <= of_effects for effect in written["effects"])
    page = (REFERENCE / "diagnosis.md").read_text(encoding="utf-8")
    assert set(SCHEMA["properties"]) | of_effects <= set(re.findall(r"`(\w+)`", page))


def _without(*keys: str) -> Callable[[dict[str, Any]], None]:
    def spoil(result: dict[str, Any]) -> None:
        inner = result
        for key in keys[:-1]:
            inner = inner[key]
        del inner[keys[-1]]

    return spoil


def _with(key: str, value: Any) -> Callable[[dict[str, Any]], None]:
    return lambda result: result.update({key: value})


@pytest.mark.parametrize(
    "spoil",
    few(
        [
            *(_without(key) for key in SCHEMA["required"]),
            _without("gap", "after"),
            _without("gap", "before", "rms_um"),
            _with("verdict", "certain"),
            _with("where", [{"axis": "time", "range": [0.0], "unit": "s", "share": 0.5}]),
            _with("where", [{"axis": "time", "range": [0.0, 1.0], "unit": "s", "share": 1.6}]),
            _with("next_experiment", {"profile": "profile.csv"}),
            _with("fmu", 3),
            _with("records", []),
        ],
        *range(0, 17, 4),
    ),
)
def test_what_is_spoiled_is_refused(written: dict[str, Any], spoil: Callable[[dict[str, Any]], None]) -> None:
    spoiled = copy.deepcopy(written)
    spoil(spoiled)
    assert not VALIDATOR.is_valid(spoiled)


def test_keys_of_the_contract_are_allowed(written: dict[str, Any]) -> None:
    more = {
        "complete": True,
        "start": "rest",
        "smallest_visible": {"creep": {"value": 0.01, "unit": "1"}},
        "unit": "mm",
    }
    more |= {"exposure_s": 0.004, "fmu": None}
    gap = {
        stage: numbers | {"rms": 1.0} if isinstance(numbers, dict) else numbers
        for stage, numbers in written["gap"].items()
    }
    assert VALIDATOR.is_valid(written | more | {"gap": gap})


def test_every_column_that_is_asked_for_is_allowed() -> None:
    column = SCHEMA["properties"]["columns_that_would_tell"]["items"]["properties"]["column"]
    assert set(column["enum"]) == {SUPPLY, ELECTRODES, TEMPERATURE}


def test_stages_are_those_of_the_catalogue() -> None:
    assert {effect.stage for effect in EFFECTS.values()} <= set(
        SCHEMA["$defs"]["effect"]["properties"]["stage"]["enum"]
    )


@pytest.mark.slow
def test_the_command_writes_what_the_schema_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diagnose", str(EXAMPLES / "record.csv"), "--out", str(tmp_path / "out")]) == 0
    capsys.readouterr()
    result = json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert_valid(result)
    assert (result["verdict"], [effect["id"] for effect in result["effects"]]) == ("named", ["creep"])
    assert result["recalibrated"]["gain"]["after"] == pytest.approx(0.95, abs=5e-3)
