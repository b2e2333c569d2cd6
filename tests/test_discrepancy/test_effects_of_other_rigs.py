"""Effects that are sought of other rigs: named there, in their own sizes, and never tried on the paper's actuator."""

from typing import Any

import numpy as np
import pytest
from told_diagnosis import record_of

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.findings import span_of
from bender_discrepancy.conclusion.numbers import number
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.effects.effect import OTHER_RIGS, PIEZO_BENDERS
from bender_discrepancy.effects.rigs import is_piezo_bender
from bender_discrepancy.records.observations import observe
from bender_discrepancy.workflow import candidate_forms, diagnose
from bender_loop.records.record import Record
from bender_plant.model import BUILT_IN, Model, load_model, model_from_table

RIG = model_from_table(
    {
        "format": 1,
        "name": "slide on a spring",
        "block": [
            {"id": "linear_transduction", "sensitivity_um_per_V": 20.0},
            {"id": "bending_modes", "first_frequency_Hz": 6.0, "damping_ratio": 0.05},
            {"id": "calibration"},
        ],
    }
)
NOISE_um = 0.3


def volts() -> np.ndarray:
    """A falling ladder of triangles of both signs, then random steps."""
    ladder = np.interp(np.arange(1500), [0, 250, 500, 750, 1000, 1250, 1500], [0, 10, -10, 6, -6, 3, 0])
    return np.concatenate([ladder, np.random.default_rng(1).uniform(-10.0, 10.0, 25).repeat(60)])


def seen_of_the_rig(effects: dict[str, dict[str, Any]]) -> Record:
    model = RIG
    for effect, parameters in effects.items():
        model = model.with_block(effect, **parameters)
    time_s = np.arange(volts().size, dtype=np.float64) / 100.0
    reading_um = Simulator(Drive.of_rows(time_s, volts())).run(model).reading_um
    return Record(time_s, volts(), reading_um + NOISE_um * np.random.default_rng(3).standard_normal(time_s.size))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect_id", "parameters"),
    [
        ("output_curve", {"quadratic_1_per_um": 3e-4}),
        ("quadratic_spring", {"quadratic_1_per_um": 5e-4}),
        ("coulomb_friction", {"level_um": 8.0}),
        ("quadratic_drag", {"drag_1_per_um": 1e-3}),
        ("hysteretic_spring", {"share": 0.3, "beta_1_per_um": 0.02}),
        ("asymmetric_gain", {"difference": 0.15}),
        ("asymmetric_dead_zone", {"positive_V": 0.4, "negative_V": 1.2}),
        # what may be taken for one of them
        ("dead_zone", {"threshold_V": 0.5}),
        ("backlash", {"half_width_um": 5.0}),
        ("stiffening", {"cubic_1_per_um2": 3e-6}),
    ],
)
def test_an_effect_of_a_rig_is_named_with_its_numbers(effect_id: str, parameters: dict[str, float]):
    found = diagnose(RIG, [seen_of_the_rig({effect_id: parameters})])
    assert (found.verdict.word, found.best.hypothesis.effects) == ("named", (effect_id,))
    named = found.best.hypothesis.model(RIG)
    block = next(x.parameters for x in named.blocks if x.id == effect_id)
    for name, value in parameters.items():
        assert getattr(block, name) == pytest.approx(value, rel=0.02)


def test_nothing_is_named_where_nothing_is_missing():
    assert diagnose(RIG, [seen_of_the_rig({})]).verdict.word == "no_gap"


def effects_tried(model: Model) -> set[str]:
    records = [record_of(model)]
    return {form.effect for form in candidate_forms(model, [observe(record) for record in records])}


@pytest.mark.parametrize("name", BUILT_IN)
def test_effects_of_other_rigs_are_not_tried_on_a_piezo_bender(name: str):
    model = load_model(name)
    others = {x.id for x in EFFECTS.values() if x.rigs == OTHER_RIGS}
    assert is_piezo_bender(model)
    assert others
    assert not effects_tried(model) & others


def test_on_other_rigs_a_curve_of_the_reading_has_its_neutral_name():
    tried = effects_tried(RIG)
    assert not is_piezo_bender(RIG)
    assert {x.id for x in EFFECTS.values() if x.rigs == OTHER_RIGS} <= tried
    assert not {x.id for x in EFFECTS.values() if x.rigs == PIEZO_BENDERS} & tried


def test_nothing_is_unusual_of_what_is_no_piezo_actuator():
    effect = EFFECTS["backlash"]
    ours = span_of(diagnose(load_model("paper"), [record_of()]))
    theirs = span_of(diagnose(RIG, [seen_of_the_rig({})]))
    assert number(effect, "half_width_um", 3.0, 0.01, ours, is_scale=True).unusual
    of_the_rig = number(effect, "half_width_um", 3.0, 0.01, theirs, is_scale=True)
    assert not of_the_rig.unusual
    assert of_the_rig.typical is None
    assert of_the_rig.why == ""
