"""A search that would take too long ends with what it has, and says so."""

from dataclasses import replace

import pytest
from told_diagnosis import levels, record_of, told

from bender_discrepancy.effects.form import Free, simple
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.search import beam, together
from bender_discrepancy.search.budget import BUDGET
from bender_discrepancy.search.evidence import EVIDENCE
from bender_discrepancy.settings import Settings
from bender_discrepancy.workflow import diagnose
from bender_plant.model import load_model

EFFECTS = {"source_resistance": {"time_constant_s": 0.03}, "dead_zone": {"threshold_V": 4.0}}


def test_more_rows_may_take_longer_up_to_a_limit():
    allowed = [BUDGET.work_for(rows) for rows in (0, 100, 5_000, 10**7)]
    assert allowed == sorted(allowed)
    assert allowed[0] == BUDGET.work_substeps
    assert allowed[-1] == BUDGET.most_work_substeps


@pytest.mark.slow
def test_no_further_step_is_begun_beyond_the_budget(monkeypatch: pytest.MonkeyPatch):
    for module in (beam, together):
        monkeypatch.setattr(module, "BUDGET", replace(BUDGET, work_substeps=1.0, work_per_row=0.0))
    diagnosis = diagnose(load_model("paper"), [record_of(effects=EFFECTS, voltage_V=levels(8.0))], Settings())
    assert diagnosis.findings.search.found.stopped
    assert len(diagnosis.added) <= 1
    assert any("the search ended early" in x for x in diagnosis.to_dict()["warnings"])


@pytest.mark.parametrize(("left", "more"), [(0.1, BUDGET.per_effect), (0.4, BUDGET.per_effect), (0.6, 0.0)])
def test_a_search_whose_certain_effects_remove_most_of_the_gap_may_take_longer(left: float, more: float):
    found = told([record_of()]).found
    rows = found.problem.all_rows
    gap = 1000.0 * found.noise_um**2 * rows
    base = replace(found.base, training_square=0.5 * gap, held_square=0.5 * gap)
    lag = Hypothesis().plus(simple("lag", Free("tau_s", 0.0, 2.0, False, (1.0,))), (1.0,))
    best = replace(base, hypothesis=lag, training_square=0.5 * left * gap, held_square=0.5 * left * gap)
    found = replace(found, base=base, best=best)
    for share, affordable in ((0.99, True), (1.01, False)):
        spent = round(share * (1.0 + more) * BUDGET.work_for(rows) / (1.0 + BUDGET.work_growth))
        assert beam._is_affordable(found, [0, spent], EVIDENCE) is affordable
