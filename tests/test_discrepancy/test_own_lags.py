"""A lag or delay of the model that is off: it is recalibrated, and what is hidden beside it keeps its name."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from few import few
from reported_diagnosis import levels, record_of

from bender_discrepancy.conclusion.contenders import alternatives
from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import Fitted, fit
from bender_discrepancy.records.observations import observe
from bender_discrepancy.workflow import affordable, candidate_forms, search_records
from bender_plant.model import load_model

PAPER = load_model("paper")
NUMBER = {"sensor_lag": "time_constant_s", "source_resistance": "time_constant_s", "transport_delay": "delay_s"}
HIDDEN: Mapping[str, Mapping[str, float]] = {
    "": {},
    "thermal_drift": {"amplitude_um": 3.0, "time_constant_s": 10.0},
    "dead_zone": {"threshold_V": 3.0},
}


@pytest.mark.parametrize("hidden", few(HIDDEN, 1))
@pytest.mark.parametrize("own", few(NUMBER, 1))
def test_a_number_of_the_model_is_recalibrated_and_no_effect_takes_its_place(own: str, hidden: str) -> None:
    """Searched beside the number as given, a lag of 30 ms for 10 ms was creep and a delay."""
    given = PAPER.with_block(own, **{NUMBER[own]: 0.01})
    bench = PAPER.with_block(own, **{NUMBER[own]: 0.03})
    effects = {hidden: dict(HIDDEN[hidden])} if hidden else {}
    found = search_records(given, [record_of(bench, effects, levels(40.0))])
    assert found.verdict.word == ("named" if hidden else "recalibrated")
    assert found.best.hypothesis.effects == ((hidden,) if hidden else ())
    changed = found.best.hypothesis.own
    assert changed is not None
    assert [x.name for x in changed.form.free] == [f"{own}.{NUMBER[own]}"]
    assert changed.values[0] == pytest.approx(0.03, rel=0.01)


@pytest.mark.parametrize("uneven", [False, True])
def test_a_disturbance_may_be_as_quick_as_the_rows_show(uneven: bool) -> None:
    """Rows at uneven times show a hum of 100 Hz, rows of 30 in a second at even ones its alias."""
    given = PAPER.with_block("sensor_lag", time_constant_s=0.01)
    record = record_of(given, {}, levels(170.0))
    if uneven:
        late_s = np.random.default_rng(3).uniform(0.0, 0.008, len(record))
        record = replace(record, time_s=record.time_s + late_s - late_s[0])
    observed = [observe(record)]
    forms = affordable(given, candidate_forms(given, observed), observed)
    (hum,) = (x for x in forms if x.effect == "periodic_disturbance")
    assert (hum.free[-1].high > 100.0) == uneven
    assert hum.free[-1].high >= 0.5 / np.median(np.diff(record.time_s))


@pytest.mark.slow
def test_one_of_two_equal_lags_is_recalibrated() -> None:
    given = load_model("beam").with_block("sensor_lag", time_constant_s=0.01)
    given = given.with_block("source_resistance", time_constant_s=0.01)
    found = search_records(given, [record_of(given.with_block("sensor_lag", time_constant_s=0.05))])
    assert found.verdict.word == "recalibrated"
    assert not found.best.hypothesis.effects


@pytest.mark.slow
def test_a_lag_that_is_not_the_models_own_is_an_effect() -> None:
    given = load_model("beam").with_block("sensor_lag", time_constant_s=0.01)
    bench = given.with_block("source_resistance", time_constant_s=0.01)
    found = search_records(given, [record_of(bench, voltage_V=levels(30.0))])
    assert found.verdict.word == "named"
    assert found.best.hypothesis.effects == ("source_resistance",)


def _fitted(problem: FitProblem, hypothesis: Hypothesis) -> Fitted:
    found = fit(problem, hypothesis)
    assert found is not None
    return found


@pytest.mark.slow
def test_what_came_nearest_is_told_where_nothing_is_certain() -> None:
    record = record_of(PAPER, {"thermal_drift": {"amplitude_um": 3.0, "time_constant_s": 10.0}}, levels(40.0))
    rough = np.random.default_rng(2).choice([-0.6, 0.6], len(record) // 20).repeat(20)
    found = search_records(PAPER, [replace(record, displacement_um=record.displacement_um + rough)])
    assert found.verdict.word != "named"
    assert not any(x.grade == "certain" for x in found.grades.effects)
    told = alternatives(found, "unexplained")
    assert "thermal_drift" in {y for x in told for y in x.effects}
    assert all(0.1 < x.closes < 0.99 for x in told)
    assert alternatives(found, "no_gap") == ()
