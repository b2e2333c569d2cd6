"""What a person should know beside the verdict, and the sentences of an ambiguous one and of the next experiment."""

from dataclasses import replace

import numpy as np
import pytest
from told_diagnosis import hypothesis, record_of, told

from bender_discrepancy.conclusion.corrected_model import Gap
from bender_discrepancy.conclusion.findings import RecalibratedNumber, ReportedEffect, find, span_of
from bender_discrepancy.conclusion.gap import Measured
from bender_discrepancy.conclusion.notes import more_than_noise, warnings
from bender_discrepancy.conclusion.numbers import number
from bender_discrepancy.conclusion.sentences import evidence, gap_sentence, headline, reason, residual
from bender_discrepancy.diagnosis import Diagnosis
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.experiment.design import Experiment
from bender_discrepancy.records.first_look import doubt
from bender_discrepancy.records.stand_in import StandIn, Suspected
from bender_discrepancy.settings import Settings
from bender_loop.records.record import Record
from bender_plant.model import load_model
from bender_report.number import Number


@pytest.mark.parametrize(("first_V", "words"), [(20.0, "only once"), (5.0, "only twice")])
def test_a_voltage_that_hardly_changes_is_said_with_what_it_cannot_show(first_V: float, words: str):
    voltage_V = np.full(300, 20.0)
    voltage_V[0] = first_V
    said = warnings(find(told([record_of(voltage_V=voltage_V)], word="no_gap")))
    assert any(words in x and "hysteresis" in x and "staircase" in x for x in said)


def test_readings_that_do_not_follow_the_voltage_are_said():
    record = record_of()
    noise_um = 0.06 * np.random.default_rng(3).standard_normal(len(record))
    idle = told([Record(record.time_s, record.voltage_V, noise_um)], word="recalibrated")
    assert any("do not follow the voltage" in x for x in warnings(find(idle)))


def test_a_reversed_sign_is_said():
    record = record_of(gain=-1.0)
    assert any("sign of the reading is reversed" in x for x in warnings(find(told([record], word="recalibrated"))))


@pytest.mark.parametrize(("gain", "another"), [(1.2, False), (8.0, False), (13.0, True), (0.07, True), (-0.5, True)])
def test_records_that_rise_otherwise_than_the_model_are_those_of_another_device(gain: float, another: bool):
    findings = find(told([record_of(gain=gain)], word="recalibrated"))
    said = [x for x in warnings(findings) if "another device" in x and "bender model fit" in x]
    assert findings.is_another_device is another
    assert len(said) == another


@pytest.mark.parametrize(("gain", "another"), [(1.2, False), (8.0, False), (13.0, True), (0.07, True), (-0.5, True)])
def test_another_device_is_wondered_about_before_the_search(gain: float, another: bool):
    assert (doubt(load_model("paper"), record_of(gain=gain), Settings()) is not None) is another


def test_readings_that_follow_nothing_are_no_other_device():
    record = record_of()
    noise_um = 0.06 * np.random.default_rng(3).standard_normal(len(record))
    assert doubt(load_model("paper"), Record(record.time_s, record.voltage_V, noise_um), Settings()) is None


@pytest.mark.parametrize(("left_um", "count"), [(0.062, 0), (0.15, 1)])
def test_more_than_noise_beside_a_named_effect_is_said(left_um: float, count: int):
    findings = find(told([record_of()], word="named"))
    before, left = Gap(3.0, 1.0, 3.0), Gap(left_um, 1.0, left_um)
    said = more_than_noise(findings, Measured(before, before, left, 0.06, [], [], []))
    assert len(said) == count
    assert all("the residual is 0.15 µm, 2.5 times the noise and 5 % of the gap" in x for x in said)


def test_every_sentence_speaks_of_the_residual_that_is_reported():
    search = told([record_of(effects={"sensor_lag": {"time_constant_s": 0.1}})], word="named")
    lag = hypothesis(search.base, search.records, ("sensor_lag", (0.1,)))
    named = told(search.records, lag, refit=False)
    findings = replace(find(named), complete=False)
    alone, left = Gap(1.0, 1.0, 1.0), Gap(0.15, 1.0, 0.15)
    measured = Measured(alone, alone, left, 0.06, [], [], [])
    assert headline(findings, measured).endswith(
        "; it closes 85 % of the gap. 0.15 µm, 2.5 times the noise, stays unexplained."
    )
    slower = RecalibratedNumber("source_resistance.time_constant_s", 0.01, 0.03, 1e-4, "s")
    beside = headline(replace(findings, recalibrated=(slower,)), measured)
    assert "; it and another source_resistance.time_constant_s close 85 % of the gap." in beside
    assert (
        reason(findings, measured)
        == f"{findings.reason}; on held-out readings the residual is 0.15 µm, 2.5 times the noise"
    )
    noise = Gap(0.055, 1.0, 0.055)
    elsewhere = headline(findings, replace(measured, after=noise))
    same = residual(replace(measured, after=replace(left, rms_um=0.0601)))
    assert same == "0.0601 µm, as large as the noise"
    assert "leaves 0.055 µm, 0.92 times the noise; structure above the noise stays in other parts" in elsewhere
    assert "unexplained" not in elsewhere
    assert "from 1 µm rms, gain and offset recalibrated, to 0.15 µm; the noise floor is 0.06 µm" in gap_sentence(
        findings, measured
    )


def test_a_gain_that_an_effect_has_taken_over_makes_no_other_device():
    search = told([record_of()], word="named")
    taken = replace(search.found.best, calibration=replace(search.found.best.calibration, gain=-0.05))
    assert find(replace(search, found=replace(search.found, best=taken))).is_another_device is False


def test_a_good_record_has_no_such_warning():
    assert warnings(find(told([record_of(gain=1.2)], word="recalibrated"))) == []


def test_unusual_values_of_one_list_are_one_warning():
    values = [-3.0, 0.01, 2.5]
    numbers = tuple(
        Number(f"gains[{k + 1}]", x, "1", 0.1, (0.002, 0.05), "ceramics", abs(x) > 1.0) for k, x in enumerate(values)
    )
    findings = replace(
        find(told([record_of()], word="no_gap")), effects=(ReportedEffect("creep", None, numbers, None),)
    )
    said = [x for x in warnings(findings) if "unusual" in x]
    assert len(said) == 1
    assert said[0].startswith("creep.gains: 2 of 3 values, −3 to 2.5, are unusual, typical sizes are 0.002 to 0.05")


def test_a_size_at_the_end_of_what_is_typical_is_usual():
    span = span_of(told([record_of()], word="no_gap"))
    low, high = 0.005, 0.12
    for value, unusual in ((1.003 * high, False), (1.1 * high, True), (0.997 * low, False), (0.8 * low, True)):
        found = number(EFFECTS["transport_delay"], "delay_s", value, 1e-5, span, True)
        assert found.typical == (low, high)
        assert found.unusual is unusual


def test_rivals_are_told_by_what_they_do_not_share():
    record, base = record_of(effects={"source_resistance": {"time_constant_s": 0.04}}), load_model("paper")
    dead, lag, slow = ("dead_zone", (1.0,)), ("source_resistance", (0.04,)), ("sensor_lag", (0.04,))
    best = hypothesis(base, [record], lag, dead)
    rival = hypothesis(base, [record], slow, dead)
    search = told([record], best, [rival], word="ambiguous", refit=False)
    left = Gap(0.2, 1.0, 0.2)
    findings = find(search)
    said = headline(findings, Measured(left, left, left, 0.06, [], [], []))
    open_ = "Beside it, these records cannot tell source resistance from sensor lag."
    assert said == f"Missing from the model: dead zone. {open_}"
    assert [x.id for x in findings.certain] == ["dead_zone"]
    surer = replace(findings, search=replace(search, settings=replace(search.settings, confidence=0.999)))
    assert "where 14 " in evidence(surer, surer.effects[0])
    assert "where 9.2 " in evidence(findings, findings.effects[0])


@pytest.mark.parametrize(
    ("moved", "own"),
    [((), "source resistance"), ((("gain", 1.0, 0.9, 0.01, "1"),), "gain at 0.9 and source resistance")],
)
def test_a_parameter_of_an_fmu_that_explains_as_much_is_told_in_the_headline(moved: tuple, own: str):
    record, base = record_of(effects={"source_resistance": {"time_constant_s": 0.04}}), load_model("paper")
    search = told([record], hypothesis(base, [record], ("source_resistance", (0.04,))))
    findings = replace(find(search), verdict="ambiguous")
    left = Gap(0.2, 1.0, 0.2)
    measured = Measured(left, left, left, 0.06, [], [], [])
    suspected = Suspected(moved, {}, (), "supply_tau at 0.05")
    stand_in = StandIn("their.fmu", "u", "y", "gain+mode", 0.0, 0.0, 1.0, suspected=suspected)
    diagnosis = Diagnosis(findings, measured, None, None, ("one.csv",), b"", stand_in=stand_in)
    assert diagnosis.sentence == f"These records cannot tell {own} from supply_tau at 0.05."
    assert diagnosis.to_dict()["effects"][0]["certain"] is False
    assert replace(diagnosis, stand_in=None).sentence != diagnosis.sentence


@pytest.mark.parametrize(("distance_um", "words"), [(1.2, "20 times the noise"), (0.0004, "no voltage that was tried")])
def test_an_experiment_says_whether_it_would_tell(distance_um: float, words: str):
    found = Experiment("a staircase", np.arange(31.0), np.linspace(0.0, 50.0, 31), distance_um, 0.06)
    assert words in found.why
    assert found.tells_apart == (distance_um > 1.0)
    assert "(30 s, 0 to 50 V)" in found.why


def test_an_experiment_does_not_tell_where_the_rivals_leave_more_than_they_differ_by():
    found = Experiment("a staircase", np.arange(31.0), np.linspace(0.0, 50.0, 31), 0.08, 0.06, 0.3)
    assert not found.tells_apart
    assert "1.3 times the noise, 0.27 times what would stay unexplained with each" in found.why
    assert replace(found, unexplained_um=0.05).tells_apart


def test_large_differences_are_told_in_three_digits():
    found = Experiment("quick steps", np.arange(31.0), np.linspace(0.0, 50.0, 31), 1129.4, 0.0595)
    assert "1100 µm rms, 19000 times the noise" in found.why


@pytest.mark.parametrize(("jitter_s", "said"), [(0.0, 1), (0.01, 0)])
def test_even_rows_do_not_distinguish_a_disturbance_from_its_aliases(jitter_s: float, said: int):
    record = record_of(effects={"periodic_disturbance": {"sine_um": 1.0, "frequency_Hz": 7.0}})
    record = replace(record, time_s=record.time_s + jitter_s * np.random.default_rng(1).random(len(record)))
    part = ("periodic_disturbance", (1.0, 0.0, 7.0))
    base = load_model("paper")
    findings = find(told([record], hypothesis(base, [record], part), refit=jitter_s == 0.0))
    found = [x for x in warnings(findings) if "looks like" in x]
    assert len(found) == said
    assert all("30 rows a second" in x and "23, 37" in x for x in found)
