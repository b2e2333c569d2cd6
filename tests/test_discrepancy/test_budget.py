"""A search that would take too long ends with what it has, and says so."""

from dataclasses import replace

import pytest
from told_diagnosis import levels, record_of

from bender_discrepancy.search import beam, together
from bender_discrepancy.search.budget import BUDGET
from bender_discrepancy.settings import Settings
from bender_discrepancy.workflow import diagnose
from bender_plant.model import load_model

EFFECTS = {"source_resistance": {"time_constant_s": 0.03}, "dead_zone": {"threshold_V": 4.0}}


def test_more_rows_may_take_longer_up_to_a_limit():
    allowed = [BUDGET.work_for(rows) for rows in (0, 100, 5_000, 10**7)]
    assert allowed == sorted(allowed)
    assert allowed[0] == BUDGET.work_substeps
    assert allowed[-1] == BUDGET.most_work_substeps


def test_no_further_step_is_begun_beyond_the_budget(monkeypatch: pytest.MonkeyPatch):
    for module in (beam, together):
        monkeypatch.setattr(module, "BUDGET", replace(BUDGET, work_substeps=1.0, work_per_row=0.0))
    diagnosis = diagnose(load_model("paper"), [record_of(effects=EFFECTS, voltage_V=levels(8.0))], Settings())
    assert diagnosis.findings.search.found.stopped
    assert len(diagnosis.added) <= 1
    assert any("the search ended early" in x for x in diagnosis.to_dict()["warnings"])
