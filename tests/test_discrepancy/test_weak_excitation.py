"""A record that hardly excites the device: what fits all of it as well cannot be excluded, however it predicts."""

import numpy as np
import pytest
from reported_diagnosis import record_of

from bender_discrepancy.settings import Settings
from bender_discrepancy.workflow import search_records
from bender_plant.model import load_model

PAPER = load_model("paper")
HELD_V = np.full(900, 24.0)
HELD_V[0] = 0.0


@pytest.mark.parametrize(
    ("effect", "parameters", "also"),
    [
        ("thermal_drift", {"amplitude_um": 0.9, "time_constant_s": 9.0}, "creep"),
        ("charge_leakage", {"fraction": 0.9, "time_constant_s": 150.0}, "thermal_drift"),
    ],
)
def test_what_fits_every_row_as_well_stays_a_rival(effect: str, parameters: dict[str, float], also: str):
    record = record_of(PAPER, {effect: parameters}, voltage_V=HELD_V)
    found = search_records(PAPER, [record], Settings())
    assert found.verdict.word == "ambiguous"
    (leading,) = found.grades.effects
    assert leading.grade != "certain"
    assert {effect, also} <= {leading.id, *(x.id for x in leading.near_rivals)}
