"""So few readings that the criterion cannot weigh the numbers of a hypothesis: said, never written as a number."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reported_diagnosis import hypothesis, record_of, told

from bender_discrepancy.conclusion.diagnosis_json import outcome
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.conclusion.measurement.gap import measure
from bender_discrepancy.report.page import report_page
from bender_discrepancy.report.summary import summary
from bender_plant.model import load_model

LAG = {"source_resistance": {"time_constant_s": 0.06}}


@pytest.mark.parametrize("difference", [math.inf, -math.inf])
def test_a_rival_that_cannot_be_weighed_has_no_number(difference: float, tmp_path: Path) -> None:
    record = record_of(effects=LAG, voltage_V=np.repeat([0.0, 20.0, 40.0, 10.0], 25))
    best, rival = (hypothesis(load_model("paper"), [record], (x, (0.06,))) for x in ("source_resistance", "sensor_lag"))
    search = told([record], best, [rival], word="ambiguous")
    (effect,) = search.grades.effects
    rivals = tuple(replace(x, difference=difference) for x in effect.rivals)
    assert rivals
    grades = replace(search.grades, effects=(replace(effect, rivals=rivals, difference=math.inf),))
    findings = find(replace(search, grades=grades))
    measured = measure(findings.search, findings.model, findings.calibration, tmp_path / "model.fmu")
    result = outcome(findings, measured)
    told_again = json.loads(json.dumps(result, allow_nan=False))
    assert told_again["effects"][0]["rivals"][0]["delta_bic"] is None
    assert told_again["effects"][0]["delta_bic_without"] is None
    assert "and there are too few readings to choose between them" in " ".join(
        " ".join(summary(findings, measured, result, tmp_path)).split()
    )
    assert "inf" not in report_page(findings, measured, result).split("<body")[1].replace("information", "").split()
