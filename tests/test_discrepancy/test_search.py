"""Effects that show only together, and early choices that must be taken back."""

import numpy as np
from told_diagnosis import levels, record_of

from bender_discrepancy.workflow import search_records
from bender_plant.model import load_model

PAPER = load_model("paper")


def test_two_effects_of_which_one_alone_explains_little() -> None:
    effects = {
        "dead_zone": {"threshold_V": 7.0},
        "creep": {"gains": (0.08, 0.05), "time_constants_s": (0.7, 6.0)},
    }
    found = search_records(PAPER, [record_of(effects=effects, voltage_V=levels(25.0))])
    assert found.verdict.word == "named"
    assert set(found.best.hypothesis.effects) == {"dead_zone", "creep"}


def test_an_early_choice_is_taken_back() -> None:
    """A lag of the sensor looks like one of the source until the second effect is there."""
    effects = {"supply_fall_lag": {"time_constant_s": 0.06}, "sensor_lag": {"time_constant_s": 0.04}}
    found = search_records(PAPER, [record_of(effects=effects, voltage_V=levels(25.0))])
    assert found.verdict.word == "named"
    assert set(found.best.hypothesis.effects) == {"supply_fall_lag", "sensor_lag"}
    replaced = [x.fitted.hypothesis.effects for x in found.found.last_ranking]
    assert any(set(x) == {"supply_fall_lag", "source_resistance"} for x in replaced)


def test_every_set_of_forms_is_ranked_once() -> None:
    found = search_records(PAPER, [record_of(effects={"backlash": {"half_width_um": 1.0}})]).found
    names = [frozenset(part.form.name for part in x.fitted.hypothesis.parts) for x in found.last_ranking]
    assert len(names) == len(set(names))
    assert list(found.last_ranking) == sorted(found.last_ranking, key=lambda x: x.difference)
    assert np.isfinite(found.noise_um)
