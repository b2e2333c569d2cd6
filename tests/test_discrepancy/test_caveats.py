"""What to know beside the verdict: another device, an unusual size, an experiment that would not decide."""

from dataclasses import replace

import numpy as np
import pytest
from reported_diagnosis import record_of, told

from bender_discrepancy.conclusion.findings import find, span_of
from bender_discrepancy.conclusion.notes import warnings
from bender_discrepancy.conclusion.numbers import number
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.experiment.design import Experiment
from bender_discrepancy.records.first_look import doubt
from bender_discrepancy.settings import Settings
from bender_loop.records.record import Record
from bender_plant.model import load_model


@pytest.mark.parametrize(("gain", "another"), [(1.2, False), (8.0, False), (13.0, True), (0.07, True), (-0.5, True)])
def test_records_that_rise_otherwise_than_the_model_are_those_of_another_device(gain: float, another: bool):
    record = record_of(gain=gain)
    assert find(told([record], word="recalibrated")).is_another_device is another
    assert (doubt(load_model("paper"), record, Settings()) is not None) is another


def test_readings_that_follow_nothing_are_no_other_device():
    record = record_of()
    noise_um = 0.06 * np.random.default_rng(3).standard_normal(len(record))
    assert doubt(load_model("paper"), Record(record.time_s, record.voltage_V, noise_um), Settings()) is None


def test_a_gain_that_an_effect_has_taken_over_makes_no_other_device():
    search = told([record_of()], word="named")
    taken = replace(search.found.best, calibration=replace(search.found.best.calibration, gain=-0.05))
    assert find(replace(search, found=replace(search.found, best=taken))).is_another_device is False


def test_a_size_at_the_end_of_what_is_typical_is_usual():
    span = span_of(told([record_of()], word="no_gap"))
    low, high = 0.005, 0.12
    for value, unusual in ((1.003 * high, False), (1.1 * high, True), (0.997 * low, False), (0.8 * low, True)):
        found = number(EFFECTS["transport_delay"], "delay_s", value, 1e-5, span, True)
        assert found.typical == (low, high)
        assert found.unusual is unusual


@pytest.mark.parametrize(
    ("distance_um", "unexplained_um", "decides"), [(1.2, 0.0, True), (0.0004, 0.0, False), (0.08, 0.3, False)]
)
def test_an_experiment_decides_where_rivals_differ_by_more_than_noise_and_the_unexplained(
    distance_um: float, unexplained_um: float, decides: bool
):
    found = Experiment("a staircase", np.arange(31.0), np.linspace(0.0, 50.0, 31), distance_um, 0.06, unexplained_um)
    assert found.tells_apart is decides


@pytest.mark.parametrize(
    ("first_s", "step_s", "untimed", "is_said"),
    [(0.0, 1.0, False, True), (1.0, 1.0, False, True), (0.0, 1.0, True, False), (0.0, 0.5, False, False)],
)
def test_times_that_are_the_numbers_of_the_rows_may_be_no_seconds(
    first_s: float, step_s: float, untimed: bool, is_said: bool
):
    record = record_of()
    numbered = Record(
        first_s + step_s * np.arange(len(record), dtype=np.float64), record.voltage_V, record.displacement_um
    )
    search = told([numbered], word="recalibrated")
    found = find(replace(search, settings=replace(search.settings, untimed=untimed)))
    assert any("numbers of the rows" in x for x in warnings(found)) is is_said
