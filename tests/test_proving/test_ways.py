"""Several effects, faint ones, forms moved away, records that begin in motion, and closed loops."""

from dataclasses import replace

import numpy as np
import pytest
from bender_proving import NOISE_UM, Bench, cases, make_case, strength
from bender_proving.cases import draw
from bender_proving.cases.draw import LEAST
from bender_proving.cases.hidden import Hidden
from bender_proving.cases.lookalikes import lookalike
from bender_proving.cases.residual import left_over_um
from bender_proving.cases.rivals import mimicked_um
from bender_proving.chain import readings_um
from bender_proving.records import closed_loop
from bender_proving.records.excitation import RATE_HZ, Excitation, even
from bender_proving.records.moved import moved_um


def test_a_stiffer_spring_behind_a_slow_sensor_does_not_show_beside_a_drift():
    """Its ringing does not pass the sensor: what stays is a gain, and beside a drift a gain and another drift."""
    stiffer = Hidden("tip_mass", "stiffness", 0.31, (("frequency_ratio", 1.31), ("static_gain", 1.31**-2)))
    drift = Hidden("thermal_drift", "erf", -5.2, (("change_um", -5.2), ("tau_s", 55.6), ("span_s", 170.0)))
    poles = ("tau_s", 0.085), ("second_tau_s", 1e-4), ("third_tau_s", 0.0)
    slow = Hidden("sensor_lag", "small_poles", 0.085, poles)
    plan = Bench(make_case("nothing", (), 4, "camera")).excitation()
    floor_um = LEAST * NOISE_UM["camera"]
    assert draw._shows_beside(stiffer, (stiffer,), plan, floor_um)
    assert draw._shows_beside(drift, (stiffer, drift, slow), plan, floor_um)
    assert draw._shows_beside(slow, (stiffer, drift, slow), plan, floor_um)
    assert not draw._shows_beside(stiffer, (stiffer, drift, slow), plan, floor_um)


def test_steps_of_the_sensor_are_noise_to_what_stands_beside_them():
    coarse = Hidden("sensor_quantisation", "nearest", 0.8, (("step_um", 0.8),))
    drift = Hidden("thermal_drift", "erf", -1.2, (("change_um", -1.2), ("tau_s", 55.6), ("span_s", 170.0)))
    plan = Bench(make_case("nothing", (), 4, "camera")).excitation()
    floor_um = LEAST * NOISE_UM["camera"]
    assert draw._shows_beside(drift, (drift,), plan, floor_um)
    assert not draw._shows_beside(drift, (drift, coarse), plan, floor_um)


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


@pytest.mark.parametrize("wrong", [0.0, 0.5, 3.0])
def test_commands_agree_with_the_readings_whatever_is_foretold(wrong, monkeypatch):
    """A plant that remembers: what is foretold of it only decides how soon commands and readings agree."""
    monkeypatch.setattr(closed_loop, "ROWS", 120)
    monkeypatch.setattr(closed_loop, "_STRETCH", 50)
    target = np.linspace(1.0, 12.0, 120)

    def seen_um(plan):
        late = np.concatenate([[0.0, 0.0], plan.voltage_V[:-2]])
        return 0.3 * late + 0.002 * np.cumsum(late)

    answer = wrong * np.array([0.0, 0.302, 0.002])
    voltage = closed_loop._followed(target, 0.4, 3.0, seen_um, answer)
    one_by_one = np.zeros(120)
    for row in range(120):
        error = target - seen_um(even("camera", one_by_one))
        one_by_one[row] = closed_loop._commanded(error, one_by_one, np.zeros(1), 0.4, 3.0 / RATE_HZ["camera"])[row]
    assert np.array_equal(voltage, one_by_one)


def test_a_closed_loop_is_causal():
    """Another reading at the end changes no command before it."""
    rng = np.random.default_rng
    target, before, answer = np.linspace(0.0, 10.0, 90), rng(2).uniform(0.0, 50.0, size=90), np.array([0.4, -0.1])
    one = closed_loop._commanded(target, before, answer, 0.1, 0.2)
    changed = np.concatenate([target[:60], rng(1).normal(size=30)])
    other = closed_loop._commanded(changed, np.concatenate([before[:60], np.zeros(30)]), answer, 0.1, 0.2)
    assert np.array_equal(one[:60], other[:60])
    assert one.min() >= 0.0
    assert one.max() <= 50.0


def test_selections_take_turns():
    begun = list(cases("starts", (1,)))
    assert [(x.start, x.closed_loop) for x in begun] == [("motion", False), ("step", False), ("rest", True)]
