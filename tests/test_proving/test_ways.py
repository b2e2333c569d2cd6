"""Several effects, faint ones, forms moved away, records that begin in motion, and closed loops."""

from dataclasses import replace

import numpy as np
import pytest
from bender_proving import Bench, cases, make_case, strength
from bender_proving.cases.hidden import Hidden
from bender_proving.cases.lookalikes import lookalike
from bender_proving.cases.residual import left_over_um
from bender_proving.cases.rivals import mimicked_um
from bender_proving.chain import readings_um
from bender_proving.records import closed_loop
from bender_proving.records.excitation import Excitation
from bender_proving.records.moved import moved_um


@pytest.mark.parametrize("moved", [0.05, 0.2])
def test_a_moved_form_has_a_part_that_no_size_of_the_effect_takes_up(moved: float):
    case = make_case("moved", ("dead_zone",), 2, "vibrometer", moved=moved)
    bench = Bench(case)
    plan = bench.excitation()
    nominal, given = readings_um(plan.commands), readings_um(plan.commands, case.effects)
    seen = (bench.clean(plan) - case.offset_um) / case.gain
    known = np.column_stack([np.ones_like(nominal), nominal, given - nominal])
    left = seen - given
    assert np.sqrt(np.mean(left**2)) == pytest.approx(moved * left_over_um(given, nominal), rel=1e-6)
    assert np.abs(known.T @ left).max() <= 1e-6 * np.abs(known).max() * len(left) * np.abs(left).max()
    assert bench.clean(plan) == pytest.approx(bench.clean(plan), abs=0.0)


@pytest.mark.slow
def test_a_lag_is_within_what_it_is_moved_by_on_the_other_side_and_a_dead_zone_is_itself():
    """The plant is nearly linear: before it or behind it, a lag does nearly the same."""
    assert lookalike(make_case("moved", ("source_resistance",), 30401, "camera", moved=0.1)) == "sensor_lag"
    assert lookalike(make_case("moved", ("dead_zone",), 2, "vibrometer", moved=0.2)) == ""


@pytest.mark.slow
def test_how_near_another_effect_comes_is_held_to_what_the_form_is_moved_by():
    case = make_case("moved", ("source_resistance",), 30401, "camera", moved=0.1)
    plan = Bench(case).excitation()
    reading, nominal = readings_um(plan.commands, case.effects)[plan.recorded], readings_um(plan.commands)
    share = mimicked_um("sensor_lag", reading, plan) / left_over_um(reading, nominal[plan.recorded])
    assert 0.0 < share < 0.1
    assert lookalike(replace(case, moved=0.9 * share)) != "sensor_lag"
    with pytest.raises(ValueError, match="'moved' is expected, found 'single'"):
        lookalike(make_case("single", ("dead_zone",), 2))


def test_where_nothing_is_hidden_nothing_is_moved():
    plan = Bench(make_case("nothing", (), 1, "vibrometer")).excitation()
    nominal = readings_um(plan.commands)
    assert not moved_um(nominal, nominal, plan, np.random.default_rng(0)).any()


@pytest.mark.parametrize("start", ["motion", "step"])
def test_a_record_begins_as_it_says(start: str):
    bench = Bench(make_case("nothing", (), 4, "vibrometer", start=start))  # type: ignore[arg-type]
    plan = bench.excitation()
    record = bench.record(plan, bench.noise())
    assert record.time_s[0] == 0.0
    assert record.voltage_V[0] != 0.0
    assert (abs(record.displacement_um[0] - bench.case.offset_um) > 1.0) == (start == "motion")


def test_a_closed_loop_commands_what_its_own_readings_ask_for(monkeypatch: pytest.MonkeyPatch):
    bench = Bench(replace(make_case("nothing", (), 6, "camera"), effects=make_case("single", ("creep",), 6).effects))
    heard: list[np.ndarray] = []

    def seen(plan: Excitation) -> np.ndarray:
        heard.append(bench.record(plan, bench.noise()).displacement_um)
        return heard[-1]

    monkeypatch.setattr(closed_loop, "ROWS", 120)
    plan = closed_loop.played(np.random.default_rng(0), seen)
    assert np.array_equal(heard[-1], bench.record(plan, bench.noise()).displacement_um)
    assert np.ptp(plan.voltage_V) > 1.0


def test_a_controller_that_swings_from_end_to_end_is_tuned_down(monkeypatch: pytest.MonkeyPatch):
    """A bench that answers every command sixfold, a row later: with the gains as drawn it rings without end."""
    monkeypatch.setattr(closed_loop, "ROWS", 300)

    def seen(plan: Excitation) -> np.ndarray:
        return 6.0 * 0.46 * np.concatenate([[0.0], plan.voltage_V[plan.recorded][:-1]])

    tuned = closed_loop.played(np.random.default_rng(4), seen).voltage_V
    monkeypatch.setattr(closed_loop, "_TUNINGS", 1)
    assert closed_loop.swings(closed_loop.played(np.random.default_rng(4), seen).voltage_V)
    assert not closed_loop.swings(tuned)
    assert np.ptp(tuned) > 1.0


def test_a_loop_whose_spring_gives_way_is_no_case(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(closed_loop, "ROWS", 300)
    soft = Hidden("stiffening", "cubic_quintic", -0.3, (("k3_per_um2", -5e-3), ("quintic_per_um2", 9.2e-7)))
    drawn = {"kind": "single", "effects": (soft,), "sensor": "camera", "closed_loop": True}
    case = replace(make_case("nothing", (), 4, "camera", closed_loop=True), **drawn)
    assert np.isnan(Bench(case).clean(Bench(case).excitation())).any()
    assert strength(case) == 0.0


def test_selections_take_turns():
    begun = list(cases("starts", (1,)))
    assert [(x.start, x.closed_loop) for x in begun] == [("motion", False), ("step", False), ("rest", True)]
