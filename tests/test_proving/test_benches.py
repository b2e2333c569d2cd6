"""Benches, their records, files and instruments: what is promised to the judge, what meters show."""

from few import few
from dataclasses import replace

import numpy as np
import pytest
from bender_proving import (
    NOISE_UM,
    Bench,
    make_case,
    spoiled,
)
from bender_proving.records.excitation import Excitation, played
from bender_proving.records.excitations import one_sine, rich
from bender_proving.records.frames import spoil
from bender_proving.cases.hidden import SENSORS, Sensor
from hypothesis import given
from hypothesis import strategies as st
from bender_proving.cases.case import Case
from bender_proving.records.beside import COLUMNS
from bender_proving.cases.hidden import Hidden
from bender_proving.cases.witnessed import SITUATIONS, witnessed_case
from bender_proving.chain import Commands, terminals_V
from bender_proving.records.meters import Ammeter, Thermometer, Voltmeter, drawn_voltmeter


@pytest.mark.parametrize("sensor", few(SENSORS, 0))
def test_equal_arguments_give_equal_records_and_other_seeds_others(sensor: Sensor):
    benches = [Bench(make_case("nothing", (), seed, sensor)) for seed in (7, 7, 8)]
    first, again, other = (x.record(x.excitation(), x.noise()).displacement_um for x in benches)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_the_noise_is_as_loud_as_promised():
    for sensor in SENSORS:
        bench = Bench(make_case("nothing", (), 3, sensor))
        plan = bench.excitation()
        noise = bench.record(plan, bench.noise()).displacement_um - bench.clean(plan)
        assert np.std(noise) == pytest.approx(NOISE_UM[sensor], rel=0.05)


def test_a_bench_is_called_by_a_name_that_says_nothing_of_the_truth():
    case = spoiled(make_case("single", ("second_mode",), 1))
    bench = Bench(case)
    assert "second_mode" not in case.id
    first, second = (bench.record(bench.excitation(k), bench.noise(k), k) for k in (0, 1))
    assert len(first) == len(second) == 24000
    assert not np.array_equal(first.voltage_V, second.voltage_V)
    assert np.isnan(first.displacement_um).sum() == round(0.02 * len(first))


def test_spoiled_frames_leave_the_other_rows_alone():
    case = make_case("nothing", (), 5, "vibrometer")
    worse = spoiled(case)
    assert worse.id != case.id
    plan = Bench(case).excitation()
    plain, frames = (Bench(each).record(plan, Bench(each).noise()).displacement_um for each in (case, worse))
    lost = np.isnan(frames)
    apart = np.flatnonzero(~lost & (frames != plain))
    assert lost.sum() == round(0.02 * len(plain))
    assert len(apart) == round(0.01 * len(plain))
    assert np.min(np.diff(apart)) > 1
    assert np.min(np.abs(frames[apart] - plain[apart])) >= 0.5 - 1e-9


@given(rows=st.integers(50, 400), outlying=st.floats(0.0, 0.1), lost=st.floats(0.0, 0.2), seed=st.integers(0, 99))
def test_spoiling_counts(rows: int, outlying: float, lost: float, seed: int):
    frames = spoil(np.zeros(rows), "camera", outlying, lost, np.random.default_rng(seed))
    assert np.isnan(frames).sum() == round(lost * rows)
    assert np.count_nonzero(np.nan_to_num(frames)) == round(outlying * rows)
    assert frames[0] == 0.0


def test_a_calibration_scales_reading_and_noise():
    case = make_case("calibration", ("gain_error", "offset"), 1, "vibrometer")
    assert case.gain != 1.0
    assert case.offset_um != 0.0
    true = replace(case, gain=1.0, offset_um=0.0)
    plan = Bench(case).excitation()
    wrong, right = (Bench(each).record(plan, Bench(each).noise()).displacement_um for each in (case, true))
    np.testing.assert_allclose(wrong, case.gain * right + case.offset_um, rtol=1e-12, atol=1e-9)
    for names in (("gain_error",), ("offset",)):
        single = make_case("calibration", names, 1, "vibrometer")
        assert (single.gain != 1.0, single.offset_um != 0.0) == ("gain_error" in names, "offset" in names)


def test_records_of_one_bench_share_physics_and_not_surroundings():
    case = make_case("pair", ("tip_mass", "periodic_disturbance"), 0, "vibrometer")
    bench = Bench(case)
    setting = bench.excitation(1).setting
    assert bench.hidden(0, setting) == case.effects
    first, second, again = bench.hidden(1, setting), bench.hidden(2, setting), bench.hidden(1, setting)
    assert first == again
    assert first[0] == second[0] == case.effects[0]
    assert len({hidden[1].parameters for hidden in (case.effects, first, second)}) == 3


def test_a_bench_plays_any_profile():
    bench = Bench(make_case("single", ("tip_mass",), 2, "camera"))
    record = bench.play([0.0, 1.0, 2.5], [10.0, 30.0, 0.0], np.random.default_rng(0))
    assert len(record) == round(4.0 * 30) + 1
    np.testing.assert_array_equal(record.voltage_V[[0, 29, 30, 74, 75, 120]], [10.0, 10.0, 30.0, 30.0, 0.0, 0.0])
    assert abs(record.displacement_um[0] - bench.case.offset_um) < 6 * NOISE_UM["camera"]
    for times, volts in (([0.0, 1.0], [10.0, 60.0]), ([0.0, 0.0], [1.0, 2.0]), ([0.0, 1.0], [1.0])):
        with pytest.raises(ValueError, match=r"voltage_V|time_s"):
            bench.play(times, volts, np.random.default_rng(0))


@given(volts=st.lists(st.floats(0.0, 50.0), min_size=2, max_size=8), pace=st.floats(0.05, 1.0))
def test_a_played_profile_holds_each_value(volts: list[float], pace: float):
    times = np.arange(len(volts)) * pace
    plan = played("camera", times, volts)
    latest = [max(k for k, start in enumerate(times) if start <= row + 1e-9) for row in plan.time_s]
    np.testing.assert_array_equal(plan.voltage_V, np.array(volts)[latest])


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("first", [True, False])
def test_rich_excitations_fill_their_time_and_range(sensor: Sensor, first: bool):
    plan = rich(sensor, np.random.default_rng(1), first=first)
    assert len(plan.time_s) == {"camera": 5100, "vibrometer": 24000}[sensor]
    assert np.min(plan.voltage_V) >= 0.0
    assert np.max(plan.voltage_V) <= 50.0
    assert np.ptp(plan.voltage_V) > 35.0
    np.testing.assert_array_equal(plan.voltage_V, np.round(plan.voltage_V, 3))


def test_clocks_tremble_and_commands_come_late():
    drawn = [make_case("nothing", (), seed, "camera") for seed in range(12)]
    uneven = next(case for case in drawn if case.uneven)
    late = next(case for case in drawn if case.runner_delay)
    steps = np.diff(Bench(uneven).excitation().time_s)
    assert np.std(steps) > 1e-3
    plan = Bench(late).excitation()
    assert plan.command_time_s is not None
    delays = plan.command_time_s - plan.time_s
    assert 0.0 < np.min(delays) < np.max(delays) < 0.01
    record = Bench(late).record(plan, Bench(late).noise())
    assert record.command_time_s is not None


def test_the_lead_of_a_sine_is_not_in_its_record():
    short, long = (one_sine(np.random.default_rng(4), 0.7, 12.0, 10.0, lead_s) for lead_s in (5.0, 9.0))
    np.testing.assert_allclose(short.voltage_V[short.recorded], long.voltage_V[long.recorded])
    assert short.time_s[short.recorded][0] == 0.0


def test_voltages_out_of_range_are_refused():
    with pytest.raises(ValueError, match="voltage_V"):
        Excitation("camera", np.arange(3.0), np.array([0.0, 51.0, 0.0]))
    with pytest.raises(ValueError, match="time_s"):
        Excitation("camera", np.zeros(3), np.zeros(3))


LAGS = ("source_resistance", "sensor_lag")


def _read(case: Case, column: str, number: int = 10) -> tuple[np.ndarray, np.ndarray]:
    """The commanded voltage and what the instrument shows, shapes (n,)."""
    bench = Bench(case)
    plan = bench.excitation()
    record = bench.with_columns(bench.record(plan, bench.noise(number), number), plan, (column,), number)
    shown = getattr(record, column)
    assert shown is not None
    assert shown.shape == record.voltage_V.shape
    return record.voltage_V, shown


def _off(commanded_V: np.ndarray, shown_V: np.ndarray) -> np.ndarray:
    """How far a reading lies outside what the supply was told before and in its row."""
    earlier = np.concatenate([[0.0], commanded_V[:-1]])
    return np.maximum(np.minimum(commanded_V, earlier) - shown_V, shown_V - np.maximum(commanded_V, earlier))


def _warmed_K(shown_C: np.ndarray) -> float:
    tenth = len(shown_C) // 10
    return abs(float(np.mean(shown_C[-tenth:]) - np.mean(shown_C[:tenth])))


def _lags(case: Case, column: str) -> bool:
    error_V = 0.05 + 0.005 * 50.0 + 5.0 * 0.02 + 0.01
    return bool(np.max(_off(*_read(case, column))[1:]) > error_V)


@pytest.mark.parametrize("name", few(LAGS, 0))
@pytest.mark.parametrize("moved", [0.0, 0.2])
def test_the_electrodes_show_what_lags_before_them_alone(name: str, moved: float) -> None:
    case = make_case("moved" if moved else "single", (name,), 7, "camera", moved=moved)
    assert _lags(case, "electrode_voltage_V") == (name == "source_resistance")


@pytest.mark.slow
def test_the_terminals_show_a_lag_of_the_supply_and_none_of_the_leads() -> None:
    cases = [make_case("single", (name,), seed, "camera") for name in LAGS for seed in range(8)]
    shown = [_lags(x, "supply_voltage_V") for x in cases]
    assert 0 < sum(shown[:8]) < 8
    assert not any(shown[8:])


def test_a_moved_form_moves_what_the_supply_puts_out_by_the_same_part() -> None:
    case = make_case("moved", ("source_resistance",), 7, "camera", moved=0.2)
    commanded_V, moved_V = _read(case, "electrode_voltage_V")
    _, plain_V = _read(replace(case, moved=0.0), "electrode_voltage_V")
    fitted = np.column_stack([plain_V, commanded_V, np.ones_like(plain_V)])
    of_lag_V = plain_V - fitted[:, 1:] @ np.linalg.lstsq(fitted[:, 1:], plain_V, rcond=None)[0]
    part = np.std(moved_V - plain_V) / np.std(of_lag_V)
    assert 0.1 < part < 0.3


@pytest.mark.parametrize(("name", "warms"), [("thermal_drift", True), ("creep", False)])
def test_the_thermometer_shows_what_drifts_with_the_warmth_alone(name: str, warms: bool) -> None:
    _, shown_C = _read(make_case("single", (name,), 7, "camera"), "temperature_C")
    assert (_warmed_K(shown_C) > 0.01) == warms


@pytest.mark.parametrize("column", few(COLUMNS, 0))
def test_a_bench_keeps_its_instruments_and_draws_their_noise_anew(column: str) -> None:
    case = make_case("single", ("creep",), 3, "camera")
    (_, first), (_, again), (_, other) = (_read(case, column, number) for number in (10, 10, 11))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert abs(np.mean(first - other)) < 0.01  # gain and offset are those of the bench


def test_there_is_no_instrument_for_every_column() -> None:
    with pytest.raises(KeyError, match="humidity"):
        _read(make_case("nothing", (), 1, "camera"), "humidity")


NAMES = tuple(f"{x.effect}-{x.shown_by or x.cleared_by}" for x in SITUATIONS)


@pytest.mark.parametrize("number", range(len(NAMES)), ids=NAMES)
def test_the_instruments_show_what_they_can_and_nothing_else(number: int) -> None:
    case = witnessed_case(number, 3)
    record = case.record
    assert record.temperature_C is not None
    assert (_warmed_K(record.temperature_C) > 0.01) == (case.shown_by == "thermometer")
    assert (record.current_A is not None) == (case.shown_by == "ammeter")
    if record.supply_voltage_V is None:
        assert case.shown_by == "ammeter"
        return
    # gain, offset, noise and resolution of the meter
    error_V = 0.06 + 0.005 * record.voltage_V.max() + 5.0 * 0.02 + 0.01
    off_V = _off(record.voltage_V, record.supply_voltage_V)
    assert (np.max(off_V[1:]) > error_V) == (case.shown_by == "voltmeter")


def test_the_terminals_of_a_supply_that_slews_climb_in_a_straight_line() -> None:
    rows_s = np.arange(10) / 10.0
    commands = Commands(rows_s, rows_s, np.where(rows_s >= 0.1, 5.0, 0.0))
    slow = Hidden("slew_limit", "hard", 10.0, (("rate_V_per_s", 10.0), ("landing_s", 0.0)))
    at_s = np.array([0.05, 0.1, 0.2, 0.35, 0.6, 0.9])
    assert terminals_V(commands, (slow,), at_s) == pytest.approx([0.0, 0.0, 1.0, 2.5, 5.0, 5.0])
    assert terminals_V(commands, (), at_s) == pytest.approx([0.0, 5.0, 5.0, 5.0, 5.0, 5.0])


@pytest.mark.parametrize("seed", range(5))
def test_a_voltmeter_is_read_within_each_row(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.uniform(0.5, 1.5, 200))
    at_s = drawn_voltmeter(rng).instants_s(time_s, rng)
    assert np.all(at_s >= time_s)
    assert np.all(at_s[:-1] <= time_s[1:])


def test_meters_have_errors_of_their_own() -> None:
    rng = np.random.default_rng(1)
    shown = Voltmeter(1.01, 0.1, 0.0, 0.01, 0.5, 0.0).shown_V(np.array([0.0, 10.0]), rng)
    assert shown == pytest.approx([0.1, 10.2])
    drawn_A = Ammeter(1e-6, 1e9, 1e-6, 0.0, 1e-9, 0.001).shown_A(np.array([0.0, 5.0]), np.array([0.01, 5.0]), rng)
    assert drawn_A == pytest.approx([11e-6, 1.005e-6], abs=1e-9)
    time_s = np.linspace(0.0, 10.0, 1001)
    late = Thermometer(0.0, 1e-6, 1.0, 20.0).shown_C(time_s, np.minimum(time_s, 1.0), rng)
    assert late[100] == pytest.approx(20.0 + np.exp(-1.0), abs=1e-3)
    assert late[-1] == pytest.approx(21.0, abs=1e-3)
