"""What is said of effects that held-out rows contradict, and of those that nobody would miss."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reported_diagnosis import hypothesis, record_of, told

from bender_discrepancy.conclusion.measurement.gap import Measured
from bender_discrepancy.search.judgement.grades import contradicted, grade, relevant_part
from bender_discrepancy.search.judgement.probability import Case, probability
from bender_discrepancy.search.judgement.rules import Rules
from bender_discrepancy.search.judgement.verdict import Verdict, decide
from bender_discrepancy.workflow import conclude
from bender_plant.model import load_model

PAPER = load_model("paper")
LAG, HUM = ("source_resistance", (0.06,)), ("periodic_disturbance", (0.5, 0.0, 1.3))
LAGGING = {"source_resistance": {"time_constant_s": 0.06}}


@pytest.fixture(scope="module")
def lagging():
    """A lag, found with a hum that is not there."""
    record = record_of(effects=LAGGING)
    both = hypothesis(PAPER, [record], LAG, HUM)
    return told([record], both, [hypothesis(PAPER, [record], x) for x in (LAG, HUM)])


@given(st.floats(0.0, 20.0), st.floats(1.0, 1e6), st.floats(0.0, 1.0), st.floats(-0.5, 1.0))
def test_rows_that_no_choice_saw_only_take_from_a_probability(
    deviations: float, ratio: float, closed: float, unseen: float
):
    case = Case.of(deviations, 1.0, 1.0 / ratio, closed)
    after = case.seen_by_none(unseen)
    assert probability(after) <= probability(case)
    assert after.closed <= case.closed
    assert case.seen_by_none(1.0).deviations == case.deviations


def test_nothing_is_certain_that_unseen_rows_contradict(lagging) -> None:
    effect = lagging.grades.effects[0]
    assert effect.probability > 0.9
    doubted = [contradicted(replace(effect, grade="certain"), x) for x in (0.8, 0.4, 0.0)]
    assert all(x.grade != "certain" for x in doubted)
    assert sorted((x.probability for x in doubted), reverse=True) == [x.probability for x in doubted]
    assert doubted[-1].probability < effect.probability - 0.1


def test_a_named_effect_that_unseen_rows_contradict_becomes_likely(lagging, monkeypatch: pytest.MonkeyPatch) -> None:
    sure = tuple(replace(x, grade="certain") for x in lagging.grades.effects)
    found = replace(
        lagging, grades=replace(lagging.grades, effects=sure), verdict=Verdict("named", "by hand", complete=False)
    )
    monkeypatch.setattr(Measured, "falls_short", lambda _self, _closes: True)
    diagnosis = conclude(found, ["record.csv"], lambda _: None)
    said = diagnosis.to_dict()
    assert said["verdict"] == "likely"
    assert all(x["grade"] != "certain" for x in said["effects"])
    assert "held-out readings" in diagnosis.findings.reason


def test_an_effect_that_nobody_would_miss_is_left_out(lagging) -> None:
    searched = lagging.found
    assert [x.grade == "certain" for x in grade(searched, Rules()).effects] == [True, False]
    assert relevant_part(searched, Rules()).best.hypothesis.effects == ("source_resistance",)


def test_a_certain_effect_that_nobody_would_miss_stays_only_where_it_explains_the_rest() -> None:
    small = ("periodic_disturbance", (0.2, 0.0, 1.3))
    hum = {"periodic_disturbance": {"sine_um": 0.2, "cosine_um": 0.0, "frequency_Hz": 1.3}}
    record = record_of(effects={**LAGGING, **hum})
    clicks = replace(record, displacement_um=record.displacement_um + 0.12 * np.sign(np.sin(9.0 * record.time_s)))
    kept = []
    for readings in (record, clicks):
        both = hypothesis(PAPER, [readings], LAG, small)
        found = told([readings], both, [hypothesis(PAPER, [readings], x) for x in (LAG, small)]).found
        told_grades = {x.id: x.grade for x in grade(found, Rules()).effects}
        # beside clicks that nothing explains, what knows the time alone is not certain
        assert told_grades == {
            "source_resistance": "certain",
            "periodic_disturbance": "certain" if readings is record else "likely",
        }
        kept.append(relevant_part(found, Rules(relevant=0.02)).best.hypothesis.effects)
    assert kept == [("source_resistance", "periodic_disturbance"), ("source_resistance",)]


def test_two_effects_of_which_each_is_missed_both_stay() -> None:
    effects = {**LAGGING, "periodic_disturbance": {"sine_um": 2.0, "cosine_um": 0.0, "frequency_Hz": 1.3}}
    record = record_of(effects=effects)
    large = ("periodic_disturbance", (2.0, 0.0, 1.3))
    both = hypothesis(PAPER, [record], LAG, large)
    found = told([record], both, [hypothesis(PAPER, [record], x) for x in (LAG, large)]).found
    assert relevant_part(found, Rules(relevant=0.02)).best is found.best


def test_a_residual_that_nobody_would_miss_makes_no_verdict() -> None:
    searched = told(
        [record_of(effects={"periodic_disturbance": {"sine_um": 0.1, "cosine_um": 0.0, "frequency_Hz": 1.3}})]
    ).found
    words = [decide(searched, grade(searched, x), x).word for x in (Rules(relevant=0.0), Rules(relevant=0.02))]
    assert words == ["unexplained", "no_gap"]
