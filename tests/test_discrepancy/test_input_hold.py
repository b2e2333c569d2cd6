"""What the command does between the rows: as told, else held, unless the records show another course."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from reported_diagnosis import FRAME_S, NOISE_um, record_of

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.record_search import search_records
from bender_inference import input_hold
from bender_inference.input_hold import decide_input_hold
from bender_inference.settings import Settings
from bender_loop.records.record import Record
from bender_plant.model import load_model

BEAM = load_model("beam")
ASKED = Settings().between_rows("auto")
TIME_s = FRAME_S * np.arange(900, dtype=np.float64)
QUICK_V = 20.0 + 15.0 * np.sin(2.0 * np.pi * 1.3 * TIME_s) + 4.0 * np.sin(2.0 * np.pi * 6.1 * TIME_s)
EFFECTS: list[dict[str, dict[str, Any]]] = [
    {},
    {"source_resistance": {"time_constant_s": 0.03}},
    {"transport_delay": {"delay_s": 0.02}},
    {"charge_leakage": {"fraction": 0.3, "time_constant_s": 3.0}},
    {"stiffening": {"cubic_1_per_um2": 2e-4}},
    {"supply_quantisation": {"step_V": 2.0}},
]


def course(record: Record, how: Settings = ASKED) -> str:
    return decide_input_hold(BEAM, [record], how).input_hold


@pytest.mark.parametrize("effects", EFFECTS, ids=lambda x: next(iter(x), "nothing"))
def test_a_held_command_is_held_whatever_is_missing(effects: dict[str, dict[str, Any]]) -> None:
    assert course(record_of("beam", effects, voltage_V=QUICK_V)) == "hold"


def smooth_record() -> Record:
    drive = Drive(TIME_s, TIME_s, QUICK_V, linear=True, smooth=True)
    noise_um = NOISE_um * np.random.default_rng(2).standard_normal(TIME_s.size)
    return Record(TIME_s, QUICK_V, Simulator(drive).run(BEAM).reading_um + noise_um)


@pytest.mark.parametrize("record", [record_of("beam", voltage_V=QUICK_V, linear=True), smooth_record()])
def test_another_course_is_taken_where_it_closes_the_gap(record: Record) -> None:
    assert course(record) != "hold"


@pytest.mark.parametrize("hold", ["hold", "linear", "smooth"])
def test_what_is_told_is_not_decided(hold: str) -> None:
    assert course(record_of("beam", voltage_V=QUICK_V, linear=True), Settings().between_rows(hold)) == hold


def test_rows_that_are_only_an_order_are_held() -> None:
    assert (
        course(record_of("beam", voltage_V=QUICK_V, linear=True), Settings(untimed=True).between_rows("auto")) == "hold"
    )


def test_a_command_that_stays_over_most_rows_is_held() -> None:
    steps_V = np.repeat(QUICK_V[::3], 3)
    assert course(record_of("beam", voltage_V=steps_V, linear=True)) == "hold"


def test_days_of_a_model_with_a_quick_memory_are_not_simulated_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object) -> None:
        raise AssertionError("simulated")

    monkeypatch.setattr(input_hold, "judge", never)
    record = record_of("beam", voltage_V=QUICK_V, linear=True)
    days = replace(record, time_s=1e6 * record.time_s)
    assert decide_input_hold(load_model("paper"), [days], ASKED).input_hold == "hold"


def test_uneven_rows_have_no_band() -> None:
    time_s = TIME_s + np.random.default_rng(3).uniform(0.0, 0.4 * FRAME_S, TIME_s.size)
    time_s -= time_s[0]
    volts = np.interp(time_s, TIME_s, QUICK_V)
    drive = Drive(time_s, time_s, volts, linear=True)
    noise_um = NOISE_um * np.random.default_rng(2).standard_normal(time_s.size)
    assert course(Record(time_s, volts, Simulator(drive).run(BEAM).reading_um + noise_um)) == "linear"


@pytest.mark.slow
def test_a_course_is_decided_again_once_an_effect_is_found() -> None:
    """What is missing hides the course from the model as given; with the effect in it, the course shows."""
    rng = np.random.default_rng(4)
    time_s = np.arange(1500) / 400.0
    rough_V = np.convolve(rng.normal(0.0, 12.0, time_s.size + 8), np.ones(9) / 9.0, mode="valid")
    plant = BEAM.with_block("backlash", half_width_um=3.0)
    drive = Drive(time_s, time_s, rough_V, linear=True)
    reading_um = Simulator(drive).run(plant).reading_um + rng.normal(0.0, 0.002, time_s.size)
    record = Record(time_s, rough_V, reading_um)
    assert course(record) == "hold"
    found = search_records(BEAM, [record], ASKED)
    assert found.settings.input_hold == "linear"
    assert found.settings.decide_hold
    assert found.best.hypothesis.effects == ("backlash",)
