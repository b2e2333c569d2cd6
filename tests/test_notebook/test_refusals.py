"""What a data scientist hands over, and what is said where it cannot be taken."""

import inspect
from collections.abc import Mapping
from dataclasses import fields, replace
from datetime import datetime, timedelta

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reported_diagnosis import levels, record_of

import piezo_bender as pb
from bender_loop.control.pid import Gains
from bender_loop.control.references import Profile
from bender_tuner.task.settings import TuneSettings
from piezo_bender.shared import options_as_arguments, share_of

KI = {"ki": 10.0}


def table(rows: int = 60) -> pd.DataFrame:
    time_s = np.arange(rows) / 30.0
    volts = 10.0 + 5.0 * np.sign(np.sin(time_s))
    return pd.DataFrame({"time_s": time_s, "voltage_V": volts, "displacement_um": 0.2 * volts})


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: pb.load_record(table(), columns=["time", "voltage"]), "columns: found a list, expected text such as"),  # pyright: ignore[reportArgumentType]
        (lambda: pb.load_record(table(), units=["s", "V"]), "units: found a list, expected text such"),  # pyright: ignore[reportArgumentType]
        (lambda: pb.tune(units=["V"]), "units: found a list, expected text such as 'W,K'"),  # pyright: ignore[reportArgumentType]
        (lambda: pb.load_record(table(), delimiter=","), "delimiter: no such argument of load_record"),  # pyright: ignore[reportArgumentType]
        (lambda: pb.load_record(table()["voltage_V"]), "record: found a Series, expected a path, a DataFrame"),  # pyright: ignore[reportArgumentType]
        (lambda: pb.diagnose(table(), relevant="a little"), "relevant: found 'a little', expected a share"),
        (lambda: pb.diagnose(table(), confidence="99%"), "confidence: found '99%', expected a number"),  # pyright: ignore[reportArgumentType]
        (lambda: pb.diagnose(table(), suspects=["gain"]), "suspects: found without fmu, expected with it"),
        (lambda: pb.diagnose(table(), parameters={"gain": 1.0}), "parameters: found without fmu"),
        (
            lambda: pb.watch(table(), training=table(), rows_between_false_alarms="30d"),  # pyright: ignore[reportArgumentType]
            "rows_between_false_alarms: found '30d', expected a number of rows",
        ),
        (lambda: pb.simulate_loop((1.0, 2.0, 0.0)), "gains: found a tuple, expected a gains file, a dict with kp"),  # pyright: ignore[reportArgumentType]
        (lambda: pb.simulate_loop({"k": 1.0}), "gains: found {'k': 1.0}, expected kp, ki and kd"),
        (lambda: pb.simulate_loop({"ki": "much"}), "gains: found {'ki': 'much'}, expected"),  # pyright: ignore[reportArgumentType]
        (lambda: pb.simulate_loop(KI, profile=[1.0, 2.0]), "profile: found a list, expected a CSV file, a DataFrame"),  # pyright: ignore[reportArgumentType]
        (lambda: pb.simulate_loop(KI, profile={"time_s": [0.0]}), "profile, column setpoint_um: no such column"),
        (lambda: pb.simulate_loop(KI, profile=Profile((0.0,), (5.0,)), setpoint_um=5.0), "setpoint_um: found beside"),
        (lambda: pb.simulate_loop(KI, preview=True), "preview: found with the PID block alone"),
        (lambda: pb.tune(evaluations=10.5), "evaluations: found 10.5, expected a whole number"),
        (lambda: pb.run_bench(gains=KI), "gains: found a dict, expected a file"),  # pyright: ignore[reportArgumentType]
        (lambda: pb.effects("crep"), "list them: effects()"),
    ],
)
def test_what_cannot_be_taken_is_said_in_the_words_of_python(call, said: str):
    with pytest.raises(pb.InputError) as refused:
        call()
    assert said in str(refused.value)


@pytest.mark.parametrize("kind", ["frame", "mapping", "object"])
def test_a_reference_is_the_same_from_a_table_and_from_an_object(kind: str):
    points = {"time_s": [0.0, 1.0, 2.0], "setpoint_um": [2.0, 6.0, 4.0]}
    given = {"frame": pd.DataFrame(points), "mapping": points}.get(kind, Profile((0.0, 1.0, 2.0), (2.0, 6.0, 4.0)))
    found = pb.simulate_loop(KI, "paper", profile=given)  # pyright: ignore[reportArgumentType]
    assert [round(x.to_um) for x in found.steps] == [2, 6, 4]


@pytest.mark.slow
def test_a_loop_says_that_the_pid_block_runs_where_a_model_was_to_be_followed():
    tuned = pb.tune("paper", follow_model=True, method="simc", gain_error_percent=40.0)
    assert tuned.session.recommendation is not None
    found = pb.simulate_loop(tuned, "paper", duration_s=0.5)
    assert found.controller == "PID block"
    assert "the PID block runs" in repr(found)
    assert "tune(..., gain_error_percent=5, late_frames=0)" in found._repr_html_()
    assert pb.simulate_loop(tuned, "paper", duration_s=0.5, follow_model=False).remark == ""


def test_gains_are_taken_as_a_dict():
    loops = [pb.simulate_loop(x, "paper", duration_s=0.5) for x in (Gains(0.1, 10.0), {"Kp": 0.1, "Ki": 10.0})]
    assert np.array_equal(loops[0].displacement_um, loops[1].displacement_um)


@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
def test_dates_count_from_the_first_row(zone: str | None):
    frame = table()
    since = pd.Timestamp("2026-03-01 12:00", tz=zone)
    dates = since + pd.to_timedelta(np.round(1e6 * frame["time_s"]), unit="us")
    found = pb.load_record(frame.assign(time_s=dates))
    assert found.time_s == pytest.approx(frame["time_s"], abs=1e-6)
    with pytest.raises(pb.InputError, match="column time_s: found dates or spans of time and the units 'ms,V,um'"):
        pb.load_record(frame.assign(time_s=dates), units="ms,V,um")


@given(st.lists(st.integers(1, 10**9), min_size=3, max_size=20))
def test_spans_and_dates_give_the_seconds_between_rows(steps_us: list[int]):
    at = np.cumsum(steps_us).tolist()
    volts = np.arange(len(at), dtype=float)
    for times in (
        [timedelta(microseconds=x) for x in at],
        [datetime(2026, 1, 1) + timedelta(microseconds=x) for x in at],
        np.array(at, dtype="timedelta64[us]"),
    ):
        found = pb.load_record(time_s=times, voltage_V=volts, displacement_um=volts)  # pyright: ignore[reportArgumentType]
        assert np.diff(found.time_s) == pytest.approx(1e-6 * np.diff(at), rel=1e-9, abs=1e-9)


def test_no_progress_is_silent_and_records_may_come_one_by_one():
    record = record_of(voltage_V=levels(20.0))
    whole = pb.watch([record], training=record, diagnose=False, progress=None)  # pyright: ignore[reportArgumentType]
    one_by_one = pb.watch((x for x in [record]), training=record, diagnose=False)
    assert one_by_one.watcher.rows == whole.watcher.rows > 0


def test_rows_that_come_in_one_by_one_are_watched_as_a_record_is() -> None:
    training = record_of(voltage_V=levels(40.0, seed=3), seed=3)
    record = record_of(voltage_V=levels(20.0, seed=4), seed=4)
    moved = replace(record, displacement_um=record.displacement_um + np.where(record.time_s > 10.0, 3.0, 0.0))
    whole = pb.watch(moved, training=training, diagnose=False)
    live = pb.start_watch(training=training, diagnose=False)
    assert live.units == ("V", "um")
    said = [
        event
        for row in zip(moved.time_s, moved.voltage_V, moved.displacement_um, strict=True)
        for event in live.take(*row)
    ]
    found = live.finish()
    assert len(found.alarms) == len(whole.alarms) == 1
    assert any(x["event"] == "alarm" for x in said)
    assert found.alarms[0]["since"] == whole.alarms[0]["since"]
    for rows, complaint in [
        ((1e6, 1.0, [1.0, 2.0]), "found 1, 1 and 2 rows"),
        ((0.5, 1.0, 1.0), "a time that is not after"),
        (("soon", 1.0, 1.0), "found time_s = 'soon', expected a number"),
    ]:
        with pytest.raises(pb.InputError, match=complaint):
            live.take(*rows)


def test_a_share_is_taken_in_per_cent():
    assert share_of("relevant", "1%") == share_of("relevant", 0.01) == share_of("relevant", " 1 % ") == 0.01


def test_one_method_to_compare_with_needs_no_list():
    found = pb.tune(method="zn", compare="simc")
    assert {"zn", "simc"} <= {x.method for x in found.session.contenders}


@pytest.mark.parametrize(
    ("sentence", "said"),
    [
        ("list them: bender effects", "list them: effects()"),
        ("`bender diagnose` names it", "`diagnose(records, model)` names it"),
        ("run bender tune --rate 30", "run bender tune rate_Hz 30"),
        ("bender hil was here", "run_bench(bench) was here"),
    ],
)
def test_commands_are_functions_where_they_stand_alone(sentence: str, said: str):
    assert options_as_arguments(sentence) == said


def test_each_setting_of_a_tuning_is_told_with_its_default():
    told = inspect.getdoc(pb.tune) or ""
    entries = {x.partition(":")[0].strip(): x for x in told.splitlines() if ":" in x}
    signature: Mapping[str, inspect.Parameter] = inspect.signature(pb.tune).parameters
    for x in fields(TuneSettings):
        assert x.name in entries, x.name
        assert x.name in signature
        if isinstance(x.default, float | int) and x.default:
            assert f"{x.default:g}" in entries[x.name], x.name


def test_the_settings_of_a_loop_can_be_completed():
    names = inspect.signature(pb.simulate_loop).parameters
    assert {"rate_Hz", "latency_frames", "upper_V"} <= set(names)
    assert "method" not in names
    with pytest.raises(pb.InputError, match="rate: no such setting of a loop, expected one of rate_Hz"):
        pb.simulate_loop(Gains(0.0, 10.0, 0.0), "paper", rate=5.0)
