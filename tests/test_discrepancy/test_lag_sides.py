"""Two lags and a linear plant between them: which is on which side, no record can tell."""

from dataclasses import replace

import numpy as np
import pytest
from told_diagnosis import hypothesis, levels, record_of, told

from bender_discrepancy.fitting.hypothesis import Part
from bender_discrepancy.fitting.own_numbers import own_form, told_as_effects
from bender_discrepancy.records.observations import observe
from bender_discrepancy.search.certain import lags_commute, with_lags_moved
from bender_discrepancy.workflow import candidate_forms, diagnose
from bender_plant.model import Model, load_model

BEAM = load_model("beam")
BENT = BEAM.with_block("dead_zone", threshold_V=6.0)
LAGS = {"source_resistance": {"time_constant_s": 0.3}, "sensor_lag": {"time_constant_s": 0.12}}
VALUES = ("source_resistance", (0.3,)), ("sensor_lag", (0.12,))


@pytest.mark.slow
def test_two_lags_around_a_linear_plant_are_ambiguous() -> None:
    found = diagnose(BEAM, [record_of("beam", LAGS, levels(25.0))])
    assert found.verdict == "ambiguous"
    assert {x.id for x in found.effects} == set(LAGS)
    assert found.findings.complete
    assert found.next_experiment is None
    assert found.sentence.endswith("from two lags on one side.")


def test_no_relaxation_is_larger_than_the_step_that_it_creeps_after() -> None:
    """A larger one follows as a lag does, and two lags were one and a creep."""
    record = record_of("beam", {}, levels(25.0))
    forms = [x for x in candidate_forms(BEAM, [observe(record)]) if x.effect == "creep"]
    assert len(forms) == 6
    for form in forms:
        largest = next(x for x in form.apply(BEAM, tuple(x.high for x in form.free)).blocks if x.id == "creep")
        assert max(largest.parameters.gains) == 1.0  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize(("base", "commute"), [(BEAM, True), (BENT, False)], ids=["linear", "a dead zone between"])
def test_lags_commute_where_the_plant_between_them_is_linear(base: Model, commute: bool) -> None:
    record = record_of(base, LAGS, levels(25.0))
    assert lags_commute(told([record], hypothesis(base, [record], *VALUES), base=base).found) is commute


def test_the_other_side_of_a_lag_is_tried_before_it_is_named() -> None:
    record = record_of("beam", {"sensor_lag": {"time_constant_s": 0.12}}, levels(25.0))
    found = told([record], hypothesis(BEAM, [record], ("sensor_lag", (0.12,))), base=BEAM).found
    assert with_lags_moved(found).last_ranking == found.last_ranking, "a channel excludes it: it never led"
    found = replace(found, led=frozenset({"sensor_lag", "source_resistance"}))
    again = with_lags_moved(found)
    other = again.last_ranking[-1].fitted.hypothesis
    assert other.effects == ("source_resistance",)
    assert other.values() == pytest.approx((0.12,), rel=0.02)
    assert len(again.last_ranking) == len(found.last_ranking) + 1 == len(with_lags_moved(again).last_ranking)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.0215, 0.0256])
def test_a_slight_change_of_the_damping_is_named(ratio: float) -> None:
    """From the next start of a coarse scan a slight change promises less than none."""
    record = record_of("paper", {"structural_damping": {"damping_ratio": ratio}}, levels(25.0))
    found = diagnose(load_model("paper"), [record])
    assert (found.verdict, [x.id for x in found.effects]) == ("named", ["structural_damping"])


def test_a_resonance_as_far_off_as_a_tenth_of_a_kelvin_takes_it_is_no_other_one() -> None:
    base = load_model("bench")
    own, record = own_form(base), record_of("bench")
    assert own is not None
    changed = {"bending_modes.frequency_factor": 0.9999, "bending_modes.damping_ratio": 0.03}
    values = tuple(changed.get(x.name, x.starts[0]) for x in own.free)
    told = told_as_effects(Part(own, values), candidate_forms(base, [observe(record)]))
    assert told.effects == ("structural_damping",)
    assert told.own is not None
    assert "bending_modes.frequency_factor" in [x.name for x in told.own.form.free]


def test_changed_numbers_of_the_first_mode_have_names() -> None:
    base = load_model("bench")
    own, record = own_form(base), record_of("bench")
    assert own is not None
    changed = {"bending_modes.frequency_factor": 1.02, "bending_modes.damping_ratio": 0.03}
    values = tuple(changed.get(x.name, x.starts[0]) for x in own.free)
    effects = told_as_effects(Part(own, values), candidate_forms(base, [observe(record)]))
    assert effects.effects == ("tip_mass", "structural_damping")
    kept = effects.own
    assert kept is not None
    assert [x.name for x in kept.form.free] == ["source_resistance.time_constant_s"]
    directly = own.apply(base, values)
    read = [record_of(x).displacement_um for x in (directly, effects.model(base))]
    assert np.max(np.abs(read[0] - read[1])) < 1e-9


def test_a_lag_is_found_on_the_side_where_it_fits_better_by_far() -> None:
    """A lag behind the play of a stylus is no lag of the supply."""
    loose = BEAM.with_block("backlash", half_width_um=3.0)
    record = record_of(loose, {"sensor_lag": {"time_constant_s": 0.12}}, levels(25.0))
    wrong = told([record], hypothesis(loose, [record], ("source_resistance", (0.12,))), base=loose).found
    found = with_lags_moved(replace(wrong, led=frozenset({"sensor_lag", "source_resistance"})))
    assert found.best.hypothesis.effects == found.steps[-1].hypothesis.effects == ("sensor_lag",)
    assert found.best.hypothesis.values() == pytest.approx((0.12,), rel=0.02)
    assert any(x.fitted is wrong.best for x in found.last_ranking)
