"""Effects are called in the words of the device."""

from dataclasses import replace
from pathlib import Path

import pytest
from reported_diagnosis import hypothesis, record_of, told

from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.conclusion.measurement.gap import measure
from bender_discrepancy.conclusion.sentences import heading_of, reason, title_of
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_plant.model import load_model
from bender_report.wording import shown_in

WORDS_OF_A_PIEZO = ("bending", "supply", "source", "electro", "charge")


def test_a_device_of_other_quantities_has_no_word_of_a_piezo() -> None:
    with shown_in("mm", "N"):
        titles = [heading_of(x) for x in EFFECTS if EFFECTS[x].rigs != "piezo benders"]
    assert not [x for x in titles if any(y in x.lower() for y in WORDS_OF_A_PIEZO)]


def test_a_voltage_and_a_displacement_have_the_titles_of_the_catalogue() -> None:
    with shown_in("V", "um"):
        assert all(heading_of(x) == EFFECTS[x].title for x in EFFECTS)
    assert title_of("second_mode") == "a second bending mode"


@pytest.mark.slow
def test_the_reason_of_a_verdict_is_a_sentence(tmp_path: Path) -> None:
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.03}})
    found = told([record], hypothesis(load_model("paper"), [record], ("source_resistance", (0.03,))))
    why = replace(found.verdict, reason="the records fit sensor_lag, creep and no_such_thing as well")
    findings = find(replace(found, verdict=why))
    measured = measure(findings.search, findings.model, findings.calibration, tmp_path / "model.fmu")
    assert reason(findings, measured).startswith("the records fit sensor lag, creep and no_such_thing as well")
