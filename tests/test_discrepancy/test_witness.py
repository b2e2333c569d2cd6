"""What read-back voltage, current and temperature exclude and show, and which columns are asked for."""

import math
from dataclasses import replace

import numpy as np
import pytest
from few import few
from hypothesis import given
from hypothesis import strategies as st
from reported_diagnosis import FRAME_S, record_of

from bender_discrepancy.workflow import diagnose
from bender_effects.catalogue import forms
from bender_effects.effect import Sizes
from bender_inference.records.checks import read_model
from bender_inference.witnesses.ammeter import slew_range_V_per_s
from bender_inference.witnesses.missing_columns import missing_columns
from bender_inference.witnesses.read_back import read_back as counted_rows
from bender_inference.witnesses.testimony import Witnesses, judge_channels
from bender_loop.records.record import Record
from bender_proving.cases.witnessed import SITUATIONS, witnessed_case

RATE_HZ, FINE = 30.0, 100


def read_back(levels_V, how, rng, late):
    """The terminals' voltage when each row was read back, by steps of a hundredth of a row."""
    dt, volts, seen = 1.0 / RATE_HZ / FINE, 0.0, []
    at = max(1, round(late * FINE))
    for level in levels_V:
        for k in range(FINE):
            volts = how(volts, level, dt)
            if k + 1 == at:
                seen.append(volts)
    return np.array(seen) + 0.004 * rng.standard_normal(len(seen))


def faithful(volts, level, dt):
    return level


def slewing(rate):
    return lambda volts, level, dt: volts + np.clip(level - volts, -rate * dt, rate * dt)


def falling(tau):
    return lambda volts, level, dt: level if level >= volts else level + (volts - level) * math.exp(-dt / tau)


def stepping(step):
    return lambda volts, level, dt: step * round(level / step)


def record(how, seed, late=0.3):
    rng = np.random.default_rng(seed)
    levels = np.repeat(rng.uniform(0.0, 50.0, 60), rng.integers(1, 15, 60))
    time_s = np.arange(levels.size) / RATE_HZ
    return Record(time_s, levels, 0.4 * levels, supply_voltage_V=read_back(levels, how, rng, late))


FORMS = forms(Sizes(50.0, 23.0, 20.0, 104.0, True))


def witness_bounds(records) -> Witnesses:
    return judge_channels(records, FORMS, is_film=True)


def left(told, effect, name):
    """The range that is left of a number that is not excluded."""
    found = numbers(told, effect, name)
    assert found is not None
    return found


def numbers(told, effect, name):
    """The range that is left of a number, None where the effect is excluded."""
    form = next(x for x in FORMS if x.effect == effect)
    left = told.of_form(form)
    return None if left is None else next((x.low, x.high) for x in left.free if x.name == name)


@pytest.mark.parametrize("seed", few(range(6), 0))
def test_what_is_there_is_never_excluded(seed):
    size, late = np.random.default_rng([seed, 1]).uniform(0.05, 0.95, 2)

    def between(low, high):
        return low * (high / low) ** size

    for effect, name, how, true in (
        ("slew_limit", "slew_rate_V_per_s", slewing, between(5.0, 20_000.0)),
        ("supply_fall_lag", "time_constant_s", falling, between(0.001, 2.0)),
        ("supply_quantisation", "step_V", stepping, between(0.02, 10.0)),
    ):
        low, high = numbers(witness_bounds([record(how(true), seed, late)]), effect, name) or (math.inf, -math.inf)
        assert low <= true <= high, effect


@pytest.mark.slow
def test_a_faithful_read_back_leaves_no_room_for_what_matters():
    told = witness_bounds([record(faithful, 1)])
    assert left(told, "slew_limit", "slew_rate_V_per_s")[0] > 250.0
    assert left(told, "supply_fall_lag", "time_constant_s")[1] < 0.03
    assert left(told, "supply_quantisation", "step_V")[1] < 0.2
    assert "read-back voltage follows the command, which excludes steps above" in told.sentences[0]


def lagging(tau):
    return lambda volts, level, dt: level + (volts - level) * math.exp(-dt / tau)


@pytest.mark.parametrize("step_V", few([1.0, 2.0], 0))
def test_beside_an_effect_that_leaves_more_than_the_meter_no_other_is_excluded(step_V):
    """A supply that steps and lags: the lag is shown, and says nothing of the steps."""
    rng = np.random.default_rng(4)
    levels = np.repeat(rng.uniform(0.0, 50.0, 24), rng.integers(40, 60, 24))
    stepped = step_V * np.round(levels / step_V)
    seen = read_back(stepped, lagging(0.1), rng, 0.3)
    told = witness_bounds([Record(np.arange(levels.size) / RATE_HZ, levels, 0.4 * levels, supply_voltage_V=seen)])
    assert set(told.shown) == {"source_resistance"}
    assert any(x.effect == "supply_quantisation" for x in told.left(FORMS))
    assert "excludes" not in " ".join(told.sentences)
    alone = read_back(levels, lagging(0.1), rng, 0.3)
    told = witness_bounds([Record(np.arange(levels.size) / RATE_HZ, levels, 0.4 * levels, supply_voltage_V=alone)])
    assert not any(x.effect == "supply_quantisation" for x in told.left(FORMS))


def test_a_meter_with_a_gain_of_its_own_is_still_a_witness():
    one = record(faithful, 2)
    off = replace(one, supply_voltage_V=1.03 * np.asarray(one.supply_voltage_V) + 0.2)
    assert left(witness_bounds([off]), "supply_fall_lag", "time_constant_s")[1] < 0.03


@pytest.mark.parametrize("told", ["nothing", "noise", "few"])
def test_a_channel_that_cannot_be_relied_on_says_nothing(told):
    one = record(faithful, 3)
    rng = np.random.default_rng(4)
    channel = {
        "nothing": None,
        "noise": rng.uniform(0.0, 50.0, len(one)),
        "few": np.where(np.arange(len(one)) < 20, np.asarray(one.supply_voltage_V), np.nan),
    }[told]
    assert witness_bounds([replace(one, supply_voltage_V=channel)]).sentences == ()


def test_a_temperature_that_stays_excludes_drift_in_all_records_or_in_none():
    one = record(faithful, 5)
    still = replace(one, supply_voltage_V=None, temperature_C=np.full(len(one), 21.0))
    warming = replace(still, temperature_C=np.linspace(21.0, 22.0, len(one)))
    assert numbers(witness_bounds([still]), "thermal_drift", "amplitude_um") is None
    assert numbers(witness_bounds([still, warming]), "thermal_drift", "amplitude_um") is not None
    assert numbers(witness_bounds([still, one]), "thermal_drift", "amplitude_um") is not None


@pytest.mark.parametrize("number", few(range(6), 0, 1))
def test_a_read_back_shows_which_effect_of_the_supply_is_there(number):
    case = witnessed_case(number, 2)
    told = witness_bounds([case.record])
    assert set(told.shown) == {case.effect}
    assert f"the supply's read-back voltage shows {case.effect}" in told.sentences[0]
    shown = told.left([x for x in FORMS if x.effect == case.effect])
    assert all(x.shown for x in shown)
    assert told.first(shown) == (shown,)
    others = {x.effect for x in told.left(FORMS)}
    assert others & {"slew_limit", "supply_fall_lag", "supply_quantisation"} <= {case.effect}


@pytest.mark.parametrize("is_film", few([True, False], 0))
def test_a_read_back_that_follows_leaves_a_lag_behind_the_terminals_where_it_was(is_film):
    told = judge_channels([record(faithful, 6)], FORMS, is_film=is_film)
    for effect in ("source_resistance", "sensor_lag"):
        assert left(told, effect, "time_constant_s")[1] >= 1.0
    assert told.first(FORMS) == ()


@pytest.mark.parametrize("seed", few(range(4), 0))
def test_electrodes_that_follow_exclude_a_lag_before_them_and_leave_one_of_the_sensor(seed):
    one = record(faithful, seed, late=0.1 + 0.2 * seed)
    told = witness_bounds([replace(one, supply_voltage_V=None, electrode_voltage_V=one.supply_voltage_V)])
    assert left(told, "source_resistance", "time_constant_s")[1] < 0.1
    assert left(told, "sensor_lag", "time_constant_s")[1] >= 1.0
    assert left(told, "transport_delay", "delay_s") == left(Witnesses(), "transport_delay", "delay_s")
    assert left(told, "slew_limit", "slew_rate_V_per_s")[0] > 100.0
    assert told.first(FORMS) == ()
    (said,) = told.sentences
    assert said.startswith("witness: the voltage at the electrodes follows the command, which excludes ")
    assert "a lag before the electrodes above" in said


@pytest.mark.parametrize("seed", few(range(4), 0))
def test_what_acts_before_the_electrodes_is_never_excluded_there(seed):
    rng = np.random.default_rng(100 + seed)
    tau_s = float(np.exp(rng.uniform(np.log(0.002), np.log(0.3))))
    one = record(lagging(tau_s), seed, float(rng.uniform(0.05, 0.95)))
    told = witness_bounds([replace(one, supply_voltage_V=None, electrode_voltage_V=one.supply_voltage_V)])
    low, high = left(told, "source_resistance", "time_constant_s")
    assert low <= tau_s <= high


@pytest.mark.slow
def test_a_lag_of_the_leads_shows_at_the_electrodes_alone():
    terminals, electrodes = record(faithful, 3), record(lagging(0.05), 3)
    told = witness_bounds([replace(terminals, electrode_voltage_V=electrodes.supply_voltage_V)])
    assert set(told.shown) == {"source_resistance"}
    assert told.shown["source_resistance"][0] == pytest.approx(0.05, rel=0.05)
    assert [x.split(", which")[0] for x in told.sentences] == [
        "witness: the supply's read-back voltage follows the command",
        "witness: the voltage at the electrodes shows source_resistance",
    ]
    assert numbers(told, "slew_limit", "slew_rate_V_per_s") is None


@pytest.mark.slow
def test_of_a_long_record_the_rows_around_changes_count():
    """Its first thousands of rows may hold one voltage, and tell nothing of how it is followed."""
    rng = np.random.default_rng(6)
    levels = np.concatenate([np.full(4000, 10.0), np.repeat(rng.uniform(0.0, 50.0, 30), 60)])
    time_s = np.arange(levels.size) / RATE_HZ
    for tau_s, shown in ((0.0, set()), (0.05, {"source_resistance"})):
        seen = read_back(levels, lagging(tau_s) if tau_s else faithful, rng, 0.3)
        told = witness_bounds([Record(time_s, levels, 0.4 * levels, electrode_voltage_V=seen)])
        assert set(told.shown) == shown
        low, high = left(told, "source_resistance", "time_constant_s")
        assert low <= max(tau_s, 1e-6) <= high < 0.2


@pytest.mark.slow
def test_a_noisy_meter_beside_many_changes_shows_nothing_that_is_not_there():
    """Its noise is that of long holds, of which the rows right after changes hold none."""
    rng = np.random.default_rng(9)
    levels = np.repeat(rng.uniform(0.0, 50.0, 800), 12)
    seen = read_back(levels, faithful, rng, 0.3) + 0.2 * rng.standard_normal(levels.size)
    one = Record(np.arange(levels.size) / RATE_HZ, levels, 0.4 * levels, supply_voltage_V=seen)
    told = witness_bounds([one])
    assert not told.shown
    counted = counted_rows(one)
    assert counted is not None
    assert counted.noise_V == pytest.approx(0.2, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("hidden", "seen"), [("sensor_lag", faithful), ("source_resistance", lagging(0.08))])
def test_one_lag_around_a_linear_plant_is_told_by_the_electrodes_whichever_it_is(hidden, seen):
    """Before or behind a linear plant a lag does the same, whatever is played."""
    volts = np.repeat(np.random.default_rng(4).uniform(0.0, 30.0, 40), 12)
    plain = record_of("beam", {hidden: {"time_constant_s": 0.08}}, volts)
    open_ = diagnose(read_model("beam"), [plain])
    assert open_.verdict == "ambiguous"
    asked = open_.to_dict()["columns_that_would_tell"]
    assert [x["column"] for x in asked] == ["supply_voltage_V", "electrode_voltage_V"]
    probed = replace(plain, electrode_voltage_V=read_back(volts, seen, np.random.default_rng(1), 0.3))
    found = diagnose(read_model("beam"), [probed])
    assert (found.verdict, [x.id for x in found.added]) == ("named", [hidden])
    assert found.to_dict()["columns_that_would_tell"] == []


def test_a_temperature_that_changes_one_way_is_sought_as_a_drift_within_what_it_can_move():
    one, rng = record(faithful, 7), np.random.default_rng(8)
    course = 0.05 * -np.expm1(-one.time_s / 5.0)
    noisy = replace(one, supply_voltage_V=None, temperature_C=21.0 + course + 0.005 * rng.standard_normal(len(one)))
    told = witness_bounds([noisy])
    assert {x.effect for group in told.first(FORMS) for x in group} == {"thermal_drift"}
    assert 3.0 < left(told, "thermal_drift", "amplitude_um")[1] < 10.0
    even = replace(noisy, temperature_C=21.0 + 0.005 * rng.standard_normal(len(one)))
    assert witness_bounds([even]).first(FORMS) == ()
    assert left(witness_bounds([even]), "thermal_drift", "amplitude_um")[1] < 1.0


@pytest.mark.slow
def test_after_one_sine_an_effect_that_the_read_back_shows_is_named():
    """The readings alone could be those of any effect with a memory."""
    volts = 25.0 * (1.0 - np.cos(2.0 * np.pi * 0.5 * FRAME_S * np.arange(450)))
    plain = record_of("beam", {"source_resistance": {"time_constant_s": 0.15}}, volts)
    seen = read_back(volts, lagging(0.15), np.random.default_rng(1), 0.3)
    found = diagnose(read_model("beam"), [replace(plain, supply_voltage_V=seen)])
    assert (found.verdict, [x.id for x in found.added]) == ("named", ["source_resistance"])
    open_ = diagnose(read_model("beam"), [plain])
    assert open_.verdict == "ambiguous"
    assert "source_resistance" in open_.to_dict()["columns_that_would_tell"][0]["tells"]


ROWS_HZ, CAPACITANCE_F = 30.0, 1e-6


def steps(heights_V: list[float], rows: int = 25) -> np.ndarray:
    levels = np.cumsum([0.0, *heights_V])
    return np.repeat(levels, [5, *[rows] * len(heights_V)])


def charged(volts: np.ndarray, after, noise_A: float, seed: int = 0) -> Record:
    """A record with the current at the middle of each row; `after(age_s, height_V)` is drawn after a step."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(volts.size) / ROWS_HZ
    current_A = 2e-6 + noise_A * rng.standard_normal(volts.size)
    for row in np.flatnonzero(np.diff(volts)) + 1:
        ages_s = time_s[row:] - time_s[row] + 0.5 / ROWS_HZ
        current_A[row:] += after(ages_s, volts[row] - volts[row - 1])
    return Record(time_s, volts, 0.4 * volts, current_A=current_A)


def limited(rate_V_per_s: float):
    def after(ages_s, height_V):
        return np.sign(height_V) * CAPACITANCE_F * rate_V_per_s * (ages_s < abs(height_V) / rate_V_per_s)

    return after


def charging(tau_s: float):
    return lambda ages_s, height_V: CAPACITANCE_F * height_V / tau_s * np.exp(-ages_s / tau_s)


@given(st.floats(20.0, 60.0), st.integers(0, 50))
def test_the_rate_is_within_what_the_rows_allow(rate_V_per_s: float, seed: int):
    record = charged(steps([6.0, 8.0, -9.0, 12.0]), limited(rate_V_per_s), 1e-7, seed)
    found = slew_range_V_per_s([record])
    assert found is not None
    assert found[0] <= rate_V_per_s <= found[1]
    assert found[1] / found[0] < 2.0


@given(st.floats(0.003, 3.0), st.floats(1e-9, 1e-6), st.integers(0, 50))
def test_a_lag_is_no_limit(tau_s: float, noise_A: float, seed: int):
    record = charged(steps([6.0, 8.0, -9.0, 12.0], 60), charging(tau_s), noise_A, seed)
    assert slew_range_V_per_s([record]) is None


def test_noise_alone_and_a_supply_that_is_fast_enough_show_nothing():
    assert slew_range_V_per_s([charged(steps([6.0, 8.0]), lambda ages_s, _: 0.0 * ages_s, 1e-6)]) is None
    assert slew_range_V_per_s([charged(steps([6.0, 8.0]), limited(2000.0), 1e-7)]) is None


def test_a_higher_step_that_does_not_reach_the_limit_contradicts_it():
    volts = steps([6.0, 12.0])
    found = charged(volts, limited(30.0), 1e-7)
    current_A = np.array(found.current_A)
    current_A[30:] = 2e-6
    assert slew_range_V_per_s([found]) is not None
    assert slew_range_V_per_s([Record(found.time_s, volts, found.displacement_um, current_A=current_A)]) is None


def test_records_of_two_limits_show_none():
    slow, fast = (charged(steps([9.0, 12.0]), limited(x), 1e-7) for x in (20.0, 60.0))
    assert slew_range_V_per_s([slow]) is not None
    assert slew_range_V_per_s([slow, fast]) is None


def test_what_the_read_back_voltage_excludes_is_not_shown_by_the_current():
    record = charged(steps([6.0, 8.0, -9.0, 12.0]), limited(30.0), 1e-7)
    told = judge_channels([record], FORMS, is_film=True)
    assert "slew_limit" in told.shown
    assert any("current stays at its limit" in x for x in told.sentences)
    faithful = Record(
        record.time_s,
        record.voltage_V,
        record.displacement_um,
        supply_voltage_V=record.voltage_V + 0.002 * np.random.default_rng(1).standard_normal(len(record)),
        current_A=record.current_A,
    )
    told = judge_channels([faithful], FORMS, is_film=True)
    assert "slew_limit" not in told.shown


@pytest.mark.parametrize("turn", range(6))
def test_benches_at_their_limit_show_it_whatever_their_landing(turn: int):
    (number,) = (k for k, x in enumerate(SITUATIONS) if x.shown_by == "ammeter")
    case = witnessed_case(number + turn * len(SITUATIONS), 78)
    found = slew_range_V_per_s([case.record])
    assert found is not None
    assert found[0] / 1.2 <= case.hidden.magnitude <= found[1] * 1.2


ROWS = np.arange(120) / 30.0
VOLTS = np.repeat([0.0, 10.0, 30.0, 5.0], 30)
PLAIN = Record(ROWS, VOLTS, VOLTS)
READ_BACK = replace(PLAIN, supply_voltage_V=VOLTS)
PROBED = replace(PLAIN, electrode_voltage_V=VOLTS)
WARM = replace(PLAIN, temperature_C=20.0 + ROWS)
FEW = np.where(np.arange(120) < 10, VOLTS, np.nan)


def columns(*effects, records=(PLAIN,), is_film=True):
    return {x.column: x.tells for x in missing_columns(map(frozenset, effects), records, is_film=is_film)}


def test_where_the_supply_was_read_back_the_electrodes_are_asked_for_alone():
    sets = ({"source_resistance"}, {"sensor_lag"})
    assert set(columns(*sets, records=(READ_BACK,))) == {"electrode_voltage_V"}
    assert not columns(*sets, records=(PROBED,))
    assert not columns({"slew_limit"}, {"sensor_lag"}, records=(PROBED,))


def test_what_all_leaders_have_is_in_question_nowhere():
    assert not columns({"source_resistance", "creep"}, {"source_resistance", "charge_leakage"})
    assert not columns({"source_resistance"})
    assert not columns({"creep"}, {"charge_leakage"})


def test_two_effects_of_the_supply_are_told_apart_as_well():
    assert columns({"slew_limit"}, {"supply_fall_lag"}) == {"supply_voltage_V": ("slew_limit", "supply_fall_lag")}


def test_a_drift_is_told_by_the_temperature_and_both_columns_are_named_where_both_tell():
    assert columns({"thermal_drift"}, {"creep"}) == {"temperature_C": ("thermal_drift",)}
    both = columns({"thermal_drift", "slew_limit"}, {"creep", "sensor_lag"})
    assert both == {"supply_voltage_V": ("slew_limit",), "temperature_C": ("thermal_drift",)}


@pytest.mark.parametrize(("records", "left"), [((READ_BACK,), set()), ((READ_BACK, PLAIN), set())])
def test_what_one_record_of_a_bench_has_read_back_is_not_asked_for(records, left):
    assert set(columns({"slew_limit"}, {"sensor_lag"}, records=records)) == left


@pytest.mark.parametrize("read_V", [FEW, np.full(120, np.nan)], ids=["few", "none"])
def test_a_column_that_says_nothing_is_asked_for(read_V):
    empty = replace(PLAIN, supply_voltage_V=read_V, temperature_C=read_V)
    assert set(columns({"slew_limit"}, {"sensor_lag"}, records=(empty,))) == {"supply_voltage_V"}
    assert set(columns({"thermal_drift"}, {"ageing"}, records=(empty,))) == {"temperature_C"}


def test_a_temperature_is_heard_only_where_every_record_has_it():
    assert not columns({"thermal_drift"}, {"ageing"}, records=(WARM,))
    assert set(columns({"thermal_drift"}, {"ageing"}, records=(WARM, PLAIN))) == {"temperature_C"}
