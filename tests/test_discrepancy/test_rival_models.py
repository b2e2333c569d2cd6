"""The models that an open verdict leaves beside the corrected one, and what is written of them."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from reported_diagnosis import hypothesis, record_of, told

from bender_discrepancy.conclusion.findings import Findings, find
from bender_discrepancy.conclusion.measurement.gap import measure
from bender_discrepancy.diagnosis import DIAGNOSIS, FILES, Diagnosis
from bender_discrepancy.rivals import rival_models
from bender_loop.fmu.diagnosed import diagnosed
from bender_loop.fmu.file import read_description
from bender_plant.model import load_model

# on either side of a linear plant a lag is the same
BASE, LAG_S = "beam", 0.03
SIDES = "source_resistance", "sensor_lag"


@pytest.fixture(scope="module")
def ambiguous() -> Findings:
    base = load_model(BASE)
    record = record_of(BASE, effects={SIDES[0]: {"time_constant_s": LAG_S}})
    best, rival = (hypothesis(base, [record], (name, (LAG_S,))) for name in SIDES)
    return find(told([record], best, [rival], word="ambiguous", base=base))


def test_a_rival_has_its_own_effect_refitted_and_not_that_of_the_leader(ambiguous: Findings):
    (rival,) = rival_models(ambiguous)
    assert rival.effects == (SIDES[1],)
    values = rival.model.values()
    assert values["sensor_lag.time_constant"] == pytest.approx(LAG_S, rel=0.1)
    assert "source_resistance.time_constant" not in values
    assert rival.model.valid == ambiguous.model.valid
    assert SIDES[0] in {x.id for x in ambiguous.model.blocks}


def test_a_verdict_that_is_not_open_leaves_none(ambiguous: Findings):
    search = ambiguous.search
    named = replace(search, verdict=replace(search.verdict, word="named"))
    assert rival_models(find(named)) == ()


def test_the_files_are_those_that_the_diagnosis_names_and_a_tuning_finds_them(ambiguous: Findings, tmp_path: Path):
    fmu = tmp_path / "measured.fmu"
    gap = measure(ambiguous.search, ambiguous.model, ambiguous.calibration, fmu)
    diagnosis = Diagnosis(ambiguous, gap, None, None, ("record.csv",), fmu.read_bytes())
    out = tmp_path / "out"
    out.mkdir()
    diagnosis.write(out, report=False)
    told_rivals = json.loads((out / DIAGNOSIS).read_text())["rival_models"]
    assert told_rivals == [{"effects": [SIDES[1]], "model": "rival-1.toml", "fmu": "rival-1.fmu"}]
    assert {x.name for x in out.iterdir()} <= set(FILES)
    (found,) = diagnosed(out / "model.toml").rivals
    assert load_model(found.model) == rival_models(ambiguous)[0].model
    starts = {x.name: x.start for x in read_description(found.fmu).modelVariables}
    assert float(starts["sensor_lag.time_constant"]) == pytest.approx(LAG_S, rel=0.1)
