"""Parts of the gap: one meaning in terminal, page and `diagnosis.json`, and they add up."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from reported_diagnosis import hypothesis, record_of, told

from bender_discrepancy.conclusion.contenders import contenders
from bender_discrepancy.conclusion.diagnosis_json import outcome
from bender_discrepancy.conclusion.findings import Findings, find
from bender_discrepancy.conclusion.measurement.gap import Measured, measure
from bender_discrepancy.conclusion.notes import excitation_of
from bender_discrepancy.conclusion.sentences import evidence
from bender_discrepancy.conclusion.shares import held_square_um2, split
from bender_discrepancy.report.page import missing_rows, report_page
from bender_discrepancy.report.pictured_record import pictured_record
from bender_discrepancy.report.summary import summary
from bender_inference.settings import Settings
from bender_loop.records.record import Record
from bender_plant.model import load_model

PAPER = load_model("paper")
STEP_um = 1.5
LAG, HUM = ("source_resistance", (0.06,)), ("periodic_disturbance", (0.3, 0.0, 1.3))


@example(0.5, {"creep": 5e-324})
@given(st.floats(0.0, 2.0), st.dictionaries(st.text(max_size=3), st.floats(-2.0, 2.0), min_size=1, max_size=5))
def test_parts_are_no_less_than_nothing_and_add_up(closed: float, shares: dict[str, float]) -> None:
    found = split(closed, shares)
    assert set(found) == set(shares)
    assert all(0.0 <= x <= 1.0 + 1e-9 for x in found.values())
    assert sum(found.values()) == pytest.approx(min(closed, 1.0), abs=1e-9)


@pytest.mark.parametrize("closed", [math.nan, 0.0, -0.4])
def test_nothing_is_closed_by_what_makes_it_no_better(closed: float) -> None:
    assert split(closed, {"creep": 0.7, "ageing": -0.1}) == {"creep": 0.0, "ageing": 0.0}


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> tuple[Findings, Measured, dict]:
    """A lag that is found, a hum that is not there, play that nothing explains, and readings in steps."""
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.06}, "backlash": {"half_width_um": 0.5}})
    stepped = Record(record.time_s, record.voltage_V, STEP_um * np.round(record.displacement_um / STEP_um))
    best = hypothesis(PAPER, [stepped], LAG, HUM)
    rivals = [hypothesis(PAPER, [stepped], x) for x in (LAG, HUM, ("sensor_lag", (0.06,)))]
    found = find(told([stepped], best, rivals, word="likely", sensor_step_um=STEP_um))
    measured = measure(found.search, found.model, found.calibration, tmp_path_factory.mktemp("gap") / "model.fmu")
    findings = found.closing(measured)
    return findings, measured, outcome(findings, measured)


def test_what_effects_close_adds_up_to_what_the_three_gaps_and_the_floor_say(coarse: tuple) -> None:
    _, _, result = coarse
    gap = result["gap"]
    after, alone, floor = gap["after"]["rms_um"], gap["recalibrated"]["rms_um"], gap["noise_floor_um"]
    own = [x["share_of_gap"] for x in result["effects"] if "rival_of" not in x]
    assert gap["closed"] == pytest.approx(1.0 - (after**2 - floor**2) / (alone**2 - floor**2), abs=1e-3)
    assert sum(own) == pytest.approx(gap["closed"], abs=1e-3)


def test_steps_of_the_sensor_are_part_of_the_floor_and_close_nothing_of_the_gap(coarse: tuple) -> None:
    findings, measured, result = coarse
    steps = next(x for x in result["effects"] if x["id"] == "sensor_quantisation")
    assert (steps["share_of_gap"], steps["grade"], steps["certain"]) == (0.0, "certain", True)
    rounding_um = STEP_um / math.sqrt(12.0)
    assert steps["share_of_noise_floor"] == pytest.approx((rounding_um / measured.floor_um) ** 2, abs=1e-3)
    assert findings.effects[-1].share_of_gap >= 0.0


def test_what_an_effect_leaves_is_said_of_the_readings_as_they_are(coarse: tuple) -> None:
    """Coarse readings are fitted within their steps; what lies beyond these is not what anybody reads off the gap."""
    findings, measured, _ = coarse
    after = contenders(findings.search)[0].after_um
    assert after == pytest.approx(math.sqrt(held_square_um2(findings.search.best, findings.search.problem)))
    assert after >= 0.9 * STEP_um / math.sqrt(12.0)
    assert findings.effects[0].contender.after_um == measured.after.rms_um


def test_terminal_and_page_say_the_same_parts(coarse: tuple) -> None:
    findings, measured, result = coarse
    text = " ".join(" ".join(summary(findings, measured, result, Path("out"))).split())
    shares = [f"{100.0 * x['share_of_gap']:.0f}" for x in result["effects"]]
    told_parts = re.findall(r"close[sd]? ([\d.]+)(?: ± [\d.]+)? % of the gap", text)
    assert told_parts
    assert {f"{float(x):.0f}" for x in told_parts} <= {*shares, f"{100.0 * measured.closes:.0f}"}
    page = " ".join(report_page(findings, measured, result).split())
    rows = [float(x["closes"].removesuffix(" %")) for x in missing_rows(findings, measured, result) if _is_part(x)]
    assert sum(rows) == pytest.approx(100.0, abs=1.0)
    assert all(" ".join(x["closes"].split()) in page for x in missing_rows(findings, measured, result))


def _is_part(row: dict[str, str]) -> bool:
    return re.fullmatch(r"[\d.]+ %", row["closes"]) is not None


def test_a_rival_that_stays_open_is_nowhere_ruled_out(coarse: tuple) -> None:
    """The evidence is clearly against it, but it leaves less than twice as much."""
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.06}})
    best, other = (hypothesis(PAPER, [record], (x, (0.06,))) for x in ("source_resistance", "sensor_lag"))
    search = told([record], best, [other], word="likely")
    (effect,) = search.grades.effects
    rivals = tuple(replace(x, difference=56.0, reach="as large") for x in effect.rivals)
    grades = replace(search.grades, effects=(replace(effect, grade="likely", probability=0.7, rivals=rivals),))
    findings, (_, measured, _) = find(replace(search, grades=grades)), coarse
    result = outcome(findings, measured)
    lines = " ".join(" ".join(summary(findings, measured, result, Path("out"))).split())
    assert [x["id"] for x in result["effects"]] == ["source_resistance", "sensor_lag"]
    assert "next best sensor_lag, not ruled out" in lines
    assert "sensor_lag, ruled out" not in lines


@pytest.mark.parametrize(
    ("difference", "said"),
    [
        (-254.0, "fits all readings better (evidence 254)"),
        (-3.0, "9.2 would decide"),
        (56.0, "is 56 (9.2 decides), but"),
    ],
)
def test_evidence_for_a_rival_has_the_sign_of_the_readings(difference: float, said: str) -> None:
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.06}})
    best, other = (hypothesis(PAPER, [record], (x, (0.06,))) for x in ("source_resistance", "sensor_lag"))
    search = told([record], best, [other], word="likely")
    (effect,) = search.grades.effects
    rivals = tuple(replace(x, difference=difference, reach="predicts as well") for x in effect.rivals)
    grades = replace(search.grades, effects=(replace(effect, grade="likely", probability=0.7, rivals=rivals),))
    findings = find(replace(search, grades=grades))
    assert said in evidence(findings, findings.effects[-1])


def test_pictures_shade_the_rows_of_the_gap_and_no_others(coarse: tuple) -> None:
    findings, measured, _ = coarse
    shown = pictured_record(findings, measured, 0, "record")
    assert np.array_equal(shown.held_out, findings.search.problem.observations[0].reported)


def test_an_order_of_rows_has_no_seconds() -> None:
    record = record_of("beam", voltage_V=np.concatenate([np.arange(0.0, 50.0), np.arange(50.0, 0.0, -1.0)]))
    untimed = told([record], word="no_gap", base=load_model("beam"), settings=Settings(untimed=True))
    assert excitation_of(untimed) == ["51 levels"]
