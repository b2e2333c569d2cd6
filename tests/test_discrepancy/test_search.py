"""Effects that show only together, and early choices that must be taken back."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from told_diagnosis import NOISE_um, hypothesis, levels, record_of, told

from bender_compiled.simulation import Simulator
from bender_discrepancy.fitting.fit_problem import problem_of
from bender_discrepancy.fitting.output_error import fit
from bender_discrepancy.fitting.own_numbers import own_form
from bender_discrepancy.records.observations import observe
from bender_discrepancy.search import beam
from bender_discrepancy.search.beam import Candidates
from bender_discrepancy.search.budget import BUDGET
from bender_discrepancy.search.own_alone import own_alone
from bender_discrepancy.search.revise import looked_back
from bender_discrepancy.search.state import noise_of, work_so_far
from bender_discrepancy.search.step import aliases_Hz
from bender_discrepancy.workflow import candidate_forms, diagnose, search_records
from bender_loop.records.record import Record
from bender_plant.model import load_model

PAPER = load_model("paper")


@pytest.mark.slow
def test_two_effects_of_which_one_alone_explains_little() -> None:
    effects = {
        "dead_zone": {"threshold_V": 7.0},
        "creep": {"gains": (0.08, 0.05), "time_constants_s": (0.7, 6.0)},
    }
    found = search_records(PAPER, [record_of(effects=effects, voltage_V=levels(25.0))])
    assert found.verdict.word == "named"
    assert set(found.best.hypothesis.effects) == {"dead_zone", "creep"}


def test_where_no_step_helps_the_search_goes_on_from_models_that_led_less(monkeypatch: pytest.MonkeyPatch) -> None:
    effects = {"slew_limit": {"slew_rate_V_per_s": 1955.0}, "tip_mass": {"frequency_ratio": 1.076}}
    observations = observe(record_of(effects=effects, seed=1))
    sought = ("structural_damping", "source_resistance", "sensor_lag", *effects)
    forms = [x for x in candidate_forms(PAPER, [observations]) if x.effect in sought]
    monkeypatch.setattr(beam, "BUDGET", replace(BUDGET, beam=2))
    told: list[str] = []
    found = beam.search(problem_of(PAPER, (observations,)), forms, progress=told.append)
    leading = [x.fitted.hypothesis.effects for x in found.ranking][:3]
    assert leading == [("structural_damping",), ("source_resistance",), ("sensor_lag",)]
    assert told.count("no step helps: going on from models that led less") == 1
    assert set(found.best.hypothesis.effects) == set(effects)


def test_a_frequency_is_looked_at_again_at_its_aliases() -> None:
    """Frames on an even grid show 145 Hz as they show 115 Hz, if another slew limit goes with it."""
    record = record_of(effects={"slew_limit": {"slew_rate_V_per_s": 2500.0}, "tip_mass": {"frequency_ratio": 1.1}})
    known = problem_of(PAPER, (observe(record),))
    alias = fit(known, hypothesis(PAPER, [record], ("slew_limit", (3160.0,)), ("tip_mass", (1.387,))))
    assert alias is not None
    assert alias.hypothesis.values()[1] == pytest.approx(1.386, abs=0.005)
    found = looked_back(known, alias, (), NOISE_um).hypothesis.values()
    assert found == pytest.approx((2500.0, 1.1), rel=3e-3)


@given(st.floats(0.1, 500.0), st.floats(5.0, 100.0))
def test_aliases_look_alike_at_every_row(frequency_Hz: float, rate_Hz: float) -> None:
    turns = 2.0 * np.pi * np.arange(50) / rate_Hz
    for other_Hz in aliases_Hz(frequency_Hz, rate_Hz, 600.0):
        assert 0.0 < other_Hz <= 600.0
        assert np.cos(turns * other_Hz) == pytest.approx(np.cos(turns * frequency_Hz), abs=1e-6)


@pytest.mark.slow
def test_an_early_choice_is_taken_back() -> None:
    """A lag of the sensor looks like one of the source until the second effect is there."""
    effects = {"supply_fall_lag": {"time_constant_s": 0.06}, "sensor_lag": {"time_constant_s": 0.04}}
    found = search_records(PAPER, [record_of(effects=effects, voltage_V=levels(25.0))])
    assert found.verdict.word == "named"
    assert set(found.best.hypothesis.effects) == {"supply_fall_lag", "sensor_lag"}
    replaced = [x.fitted.hypothesis.effects for x in found.found.last_ranking]
    assert any(set(x) == {"supply_fall_lag", "source_resistance"} for x in replaced)


@pytest.mark.parametrize("hidden", [True, False])
def test_no_step_sets_out_from_a_model_to_which_an_effect_was_added_in_vain(hidden: bool) -> None:
    slow, lossy = ("source_resistance", (0.06,)), ("structural_damping", (0.06,))
    effects = {"source_resistance": {"time_constant_s": 0.06}}
    effects |= {"structural_damping": {"damping_ratio": 0.06}} if hidden else {}
    record = record_of(effects=effects)
    both, other = hypothesis(PAPER, [record], slow, lossy), hypothesis(PAPER, [record], ("sensor_lag", (0.06,)))
    found = told([record], hypothesis(PAPER, [record], slow), (both, other)).found
    leaders = beam._leaders(found.last_ranking, found.best, found.yardstick)
    assert leaders[0] is found.best
    assert {x.hypothesis.effects for x in leaders[1:]} == {other.effects} | ({both.effects} if hidden else set())


@pytest.mark.slow
def test_every_set_of_forms_is_ranked_once() -> None:
    found = search_records(PAPER, [record_of(effects={"backlash": {"half_width_um": 1.0}})]).found
    names = [frozenset(part.form.name for part in x.fitted.hypothesis.parts) for x in found.last_ranking]
    assert len(names) == len(set(names))
    assert list(found.last_ranking) == sorted(found.last_ranking, key=lambda x: x.difference)
    assert np.isfinite(found.noise_um)


@pytest.mark.slow
@pytest.mark.parametrize(("off_s", "seed"), [(0.03, 31), (0.25, 32)])
def test_a_lag_of_the_models_own_that_is_off_is_recalibrated_and_no_effect_is_named(off_s: float, seed: int) -> None:
    bench = load_model("bench")
    off = bench.with_block("source_resistance", time_constant_s=off_s)
    found = diagnose(bench, [record_of(off, seed=seed)])
    assert (found.verdict, found.effects) == ("recalibrated", ())
    (number,) = found.recalibrated
    assert number.name == "source_resistance.time_constant_s"
    assert (number.before, number.unit) == (0.02, "s")
    assert abs(number.after - off_s) < 4.0 * number.std
    assert number.std < 0.02 * off_s
    assert found.model.values()["source_resistance.time_constant"] == number.after
    assert found.gap.after.all_rms_um == pytest.approx(NOISE_um, rel=0.1)


@pytest.mark.slow
def test_an_effect_beside_a_lag_that_is_off_is_named() -> None:
    bench = load_model("bench")
    off = bench.with_block("source_resistance", time_constant_s=0.06).with_block("backlash", half_width_um=0.8)
    found = diagnose(bench, [record_of(off, seed=33)])
    assert (found.verdict, [x.id for x in found.added]) == ("named", ["backlash"])
    assert [x.name for x in found.recalibrated] == ["source_resistance.time_constant_s"]


@pytest.mark.parametrize("ratio", [1.1, 1.0005])
def test_another_frequency_of_the_model_beside_an_effect_is_called_by_its_name(ratio: float) -> None:
    """Freed beside an effect it ended at an alias, and a damping made up for that; within a kelvin it is a number."""
    effects = {"transport_delay": {"delay_s": 0.06}, "tip_mass": {"frequency_ratio": ratio}}
    record = record_of(effects=effects, seed=38)
    own = own_form(PAPER)
    assert own is not None
    alias = 1.387 if ratio == 1.1 else ratio
    freed = hypothesis(PAPER, [record], ("transport_delay", (0.06,))).freeing(own, (alias, 0.02 * ratio / alias))
    known = told([record], freed).found
    sought = candidate_forms(PAPER, [observe(record)])
    found = own_alone(known, own, sought, BUDGET.effects).best.hypothesis
    assert found.effects == (tuple(effects) if ratio == 1.1 else ("transport_delay",))
    if ratio == 1.1:
        assert found.values() == pytest.approx((0.06, 1.1), rel=3e-3)


def test_another_frequency_that_the_models_own_takes_back_is_not_named() -> None:
    """An effect and the model's own numbers are one change of the first mode, here of its damping alone."""
    changed = {"transport_delay": {"delay_s": 0.06}, "structural_damping": {"damping_ratio": 0.008}}
    record, own = record_of(PAPER, effects=changed, seed=32), own_form(PAPER)
    assert own is not None
    twice = hypothesis(PAPER, [record], ("transport_delay", (0.06,)), ("tip_mass", (1.05,)))
    known = told([record], twice.freeing(own, (1.0 / 1.05, 0.008 * 1.05))).found
    sought = candidate_forms(PAPER, [observe(record)])
    found = own_alone(known, own, sought, BUDGET.effects).best.hypothesis
    assert found.effects == ("transport_delay", "structural_damping")
    assert found.own is None
    assert found.values() == pytest.approx((0.06, 0.008), rel=0.02)


def test_where_structure_is_left_a_lag_that_is_off_is_not_named_as_one_that_is_missing() -> None:
    """One lag of the sensor is simpler than the three numbers of the model, until two of them are held as given."""
    bench = load_model("bench")
    record = record_of(bench.with_block("source_resistance", time_constant_s=0.25), seed=37)
    lag = told([record], hypothesis(bench, [record], ("sensor_lag", (0.22,))), base=bench).found
    assert lag.best.hypothesis.effects == ("sensor_lag",)
    found = own_alone(lag, own_form(bench), (), BUDGET.effects).best.hypothesis
    assert found.parts == ()
    assert found.values() == pytest.approx((0.25,), rel=0.01)


@pytest.mark.slow
def test_the_models_own_numbers_do_not_follow_noise() -> None:
    bench = load_model("bench")
    found = search_records(bench, [record_of(bench, seed=34)])
    assert found.verdict.word == "no_gap"
    assert found.best.hypothesis.own is None


@pytest.mark.slow
def test_records_with_sensors_of_their_own_are_held_to_their_own_noise() -> None:
    bench = load_model("bench")
    coarse = record_of(bench, seed=35)
    quiet = record_of(bench, seed=36, voltage_V=levels(seed=4))
    quiet = replace(quiet, displacement_um=quiet.displacement_um - 0.8 * (quiet.displacement_um - _read(quiet)))
    found = search_records(bench, [coarse, quiet])
    assert found.verdict.word == "no_gap"


def _read(record: Record) -> np.ndarray:
    return Simulator(observe(record).drive).run(load_model("bench")).reading_um


@pytest.mark.parametrize(("lag_s", "lower"), [(0.0, False), (0.2, True)])
def test_a_candidate_lowers_the_noise_floor_only_where_it_explains_more_than_noise(lag_s: float, lower: bool) -> None:
    """It is one more estimate of the same floor else; the smallest of many is below what chance allows for."""
    hidden = {"source_resistance": {"time_constant_s": lag_s}} if lag_s else {}
    for seed in range(11, 17):
        record = record_of(effects=hidden, voltage_V=levels(12.0), seed=seed)
        found = told([record]).found
        found = replace(found, noise_um=noise_of(found.base, found.problem))
        sought = ("source_resistance", "thermal_drift")
        forms = tuple(x for x in candidate_forms(PAPER, [observe(record)]) if x.effect in sought)
        weighed = beam._weighed(found, [found.base], Candidates(forms), [work_so_far(found.problem)])
        assert weighed is not None
        assert (weighed.found.noise_um < found.noise_um) is lower
