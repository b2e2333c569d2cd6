"""Benches, their records and files: what is promised to the judge."""

from few import few
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bender_loop.errors import InputError
from bender_loop.records.record import read_record
from bender_proving import (
    NOISE_UM,
    Bench,
    make_case,
    spoiled,
    strength,
    truth,
    write_case,
)
from bender_proving.records.excitation import Excitation, played
from bender_proving.records.excitations import one_sine, rich
from bender_proving.records.frames import spoil
from bender_proving.cases.hidden import SENSORS, Sensor
from hypothesis import given
from hypothesis import strategies as st


@pytest.mark.parametrize("sensor", few(SENSORS, 0))
def test_equal_arguments_give_equal_records_and_other_seeds_others(sensor: Sensor, tmp_path: Path):
    for k, seed in enumerate((7, 7, 8)):
        write_case(make_case("nothing", (), seed, sensor), tmp_path / str(k), tmp_path / "elsewhere")
    first, again, other = ((tmp_path / str(k) / "record.csv").read_bytes() for k in range(3))
    assert first == again
    assert first != other


def test_the_noise_is_as_loud_as_promised():
    for sensor in SENSORS:
        bench = Bench(make_case("nothing", (), 3, sensor))
        plan = bench.excitation()
        noise = bench.record(plan, bench.noise()).displacement_um - bench.clean(plan)
        assert np.std(noise) == pytest.approx(NOISE_UM[sensor], rel=0.05)


def test_files_say_nothing_of_the_truth(tmp_path: Path):
    case = spoiled(make_case("single", ("second_mode",), 1))
    path = write_case(case, tmp_path / "case", second=True)
    assert path == tmp_path / "truth" / f"{case.id}.json"
    assert {file.name for file in (tmp_path / "case").iterdir()} == {"record.csv", "second.csv"}
    told = json.loads(path.read_text(encoding="utf-8"))
    assert told == json.loads(json.dumps(truth(case, second=True)))
    assert told["effects"][0]["id"] == "second_mode"
    assert told["residual_over_noise"] == pytest.approx(strength(case))
    header = (tmp_path / "case/record.csv").read_text(encoding="utf-8").splitlines()[0]
    assert set(header.split(",")) <= {"time_s", "voltage_V", "displacement_um", "command_time_s"}
    assert "second_mode" not in case.id
    first, second = (read_record(tmp_path / "case" / name) for name in ("record.csv", "second.csv"))
    assert len(first) == len(second) == 24000
    assert not np.array_equal(first.voltage_V, second.voltage_V)
    assert np.isnan(first.displacement_um).sum() == round(0.02 * len(first))
    with pytest.raises(InputError, match="would be seen"):
        write_case(case, tmp_path / "case", tmp_path / "case" / "truth")


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
