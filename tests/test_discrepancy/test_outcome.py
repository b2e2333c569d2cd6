"""What is told of a diagnosis: numbers against other ways to the same numbers, words against the contract."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import NOISE_um, hypothesis, levels, record_of, told

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy import record_search
from bender_discrepancy.conclusion.diagnosis_json import outcome
from bender_discrepancy.conclusion.findings import Findings, find, span_of
from bender_discrepancy.conclusion.measurement.corrected_model import Gap, straight_beyond
from bender_discrepancy.conclusion.measurement.gap import Measured, measure
from bender_discrepancy.conclusion.measurement.playable import playable
from bender_discrepancy.conclusion.notes import SetAside, set_aside, warnings
from bender_discrepancy.conclusion.numbers import Span, number, numbers
from bender_discrepancy.conclusion.sentences import evidence
from bender_discrepancy.diagnosis import DIAGNOSIS, FILES, Diagnosis
from bender_discrepancy.report.page import report_page
from bender_discrepancy.report.summary import _beside, summary
from bender_discrepancy.rivals import rival_models
from bender_discrepancy.workflow import diagnose
from bender_effects.catalogue import EFFECTS
from bender_effects.form import Form, Free
from bender_inference.experiment.design import Experiment
from bender_inference.experiment.proposal import Proposal
from bender_inference.fitting.fit_problem import problem_of
from bender_inference.fitting.hypothesis import Hypothesis, Part
from bender_inference.fitting.output_error import fit
from bender_inference.fitting.own_numbers import own_form
from bender_inference.fitting.profile import Ends
from bender_inference.fitting.uncertainty import uncertainty
from bender_inference.records.first_look import doubt
from bender_inference.records.observations import observe
from bender_inference.settings import Settings
from bender_loop.fmu.diagnosed import diagnosed
from bender_loop.fmu.file import read_description
from bender_loop.records.missing_rows import completed
from bender_loop.records.record import Record
from bender_plant.model import Model, load_model, model_from_table
from bender_plant.valid_range import ValidRange

CONTRACT_KEYS = {"verdict", "effects", "recalibrated", "where", "gap", "next_experiment", "model", "fmu"}
EFFECT_KEYS = {"id", "title", "stage", "parameters", "evidence", "share_of_gap", "rivals"}
LAG = ("source_resistance", (0.04,))


def worked_out(findings: Findings, folder: Path) -> tuple[dict, Measured]:
    measured = measure(findings.search, findings.model, findings.calibration, folder / "model.fmu")
    return outcome(findings, measured), measured


@pytest.fixture(scope="module")
def lagging() -> Findings:
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.03}}, gain=0.93)
    base = load_model("paper")
    best = hypothesis(base, [record], LAG)
    return find(told([record], best, [hypothesis(base, [record], ("sensor_lag", (0.02,)))]))


def test_it_has_the_keys_of_the_contract_and_finite_numbers(lagging: Findings, tmp_path: Path):
    result, _ = worked_out(lagging, tmp_path)
    again = json.loads(json.dumps(result, allow_nan=False))
    assert again == result
    assert set(result) >= CONTRACT_KEYS
    (effect,) = result["effects"]
    assert set(effect) >= EFFECT_KEYS
    assert (effect["id"], effect["stage"]) == ("source_resistance", "supply")
    found = effect["parameters"]["time_constant_s"]
    assert found["unit"] == "s"
    assert abs(found["value"] - 0.03) < 5.0 * found["std"]
    assert [x["id"] for x in effect["rivals"]] == ["sensor_lag"]
    assert effect["rivals"][0]["delta_bic"] > 10.0
    assert effect["share_of_gap"] > 0.99
    assert result["recalibrated"]["gain"]["before"] == 1.0
    assert result["recalibrated"]["gain"]["after"] == pytest.approx(0.93, abs=2e-3)
    assert {place["axis"] for place in result["where"]} >= {"time", "voltage"}
    assert all(0.0 <= place["share"] <= 1.0 for place in result["where"])


def test_the_gap_after_is_that_of_the_corrected_model(lagging: Findings, tmp_path: Path):
    result, measured = worked_out(lagging, tmp_path)
    observations = lagging.search.problem.observations[0]
    simulated = Simulator(observations.drive).run(lagging.model).reading_um
    assert np.allclose(measured.after_um[0], simulated, atol=1e-6)
    left = (observations.measured_um - simulated)[observations.reported]
    gap = result["gap"]
    assert gap["after"]["rms_um"] == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-5)
    assert gap["before"]["rms_um"] > gap["recalibrated"]["rms_um"] > 5.0 * gap["after"]["rms_um"]
    assert gap["held_out"] is True
    assert model_from_table(lagging.model.to_table()) == lagging.model


@pytest.mark.slow
def test_deviations_are_the_scatter_of_fits_to_other_noise(lagging: Findings):
    told_std = uncertainty(lagging.search.problem, lagging.search.best)
    record = lagging.search.records[0]
    clean = lagging.search.problem.readings(lagging.search.best.hypothesis)
    assert clean is not None
    rng = np.random.default_rng(11)
    found = []
    for _ in range(40):
        noisy = Record(record.time_s, record.voltage_V, clean[0] + NOISE_um * rng.standard_normal(len(record)))
        fitted = fit(problem_of(lagging.search.base, (observe(noisy),)), lagging.search.best.hypothesis, 4)
        assert fitted is not None
        found.append((np.log(fitted.hypothesis.values()[0]), fitted.calibration.gain, *fitted.calibration.offsets_um))
    scatter = np.std(found, axis=0, ddof=1)
    expected = [np.sqrt(told_std.coordinates[0, 0]), told_std.gain / 0.93, told_std.offsets_um[0]]
    assert scatter == pytest.approx(expected, rel=0.45)


def test_an_end_of_an_interval_beyond_what_a_block_takes_is_its_limit(lagging: Findings):
    """A likelihood knows nothing of limits: a time constant of 7 ms is none of ageing."""
    free = (Free("time_constant_s", 0.01, 10.0, log=True, starts=(0.24,)),)
    form = Form("ageing", "fading", free, lambda x, values: x.with_block("ageing", loss=0.1, time_constant_s=values[0]))
    fitted = replace(lagging.search.best, hypothesis=Hypothesis((Part(form, (0.24,)),)))
    ends = (Ends(0.0075, 5.0, profiled=True),)
    told_numbers = numbers(load_model("paper"), fitted, 0, np.eye(1), Span(50.0, 20.0), ends=ends)
    found = next(x for x in told_numbers if x.name == "time_constant_s")
    assert found.interval == pytest.approx((0.01, 5.0))


def test_a_forms_own_numbers_become_those_of_the_block():
    record = record_of(effects={"creep": {"gains": (0.05,), "time_constants_s": (3.0,)}})
    base = load_model("paper")
    findings = find(told([record], hypothesis(base, [record], ("logarithmic", (0.01, 0.1)))))
    creep = findings.effects[0]
    block = next(x.parameters for x in findings.model.blocks if x.id == "creep")
    assert [x.value for x in creep.numbers if x.field == "gains"] == list(block.gains)
    assert [x.value for x in creep.numbers if x.field == "time_constants_s"] == list(block.time_constants_s)
    assert all(x.std == 0.0 and not x.unusual for x in creep.numbers if x.field == "time_constants_s")
    best = findings.search.best
    (part,) = best.hypothesis.parts
    covariance = uncertainty(findings.search.problem, best).coordinates
    middle = [free.inward(value) for free, value in zip(part.form.free, part.values, strict=True)]
    drawn = np.random.default_rng(5).multivariate_normal(middle, 1e-4 * covariance, size=3000)
    gains = []
    for coordinates in drawn:
        values = [free.outward(x) for free, x in zip(part.form.free, coordinates, strict=True)]
        gains.append(next(x.parameters.gains for x in part.form.apply(base, tuple(values)).blocks if x.id == "creep"))
    deviations = [x.std for x in creep.numbers if x.field == "gains"]
    assert deviations == pytest.approx(list(100.0 * np.std(gains, axis=0)), rel=0.1)


@pytest.mark.slow
def test_rivals_that_cannot_be_told_apart_all_stand_in_effects(tmp_path: Path):
    # on either side of a linear plant a lag is the same
    base = load_model("beam")
    record = record_of("beam", effects={"source_resistance": {"time_constant_s": 0.03}})
    best, rival = (hypothesis(base, [record], (name, (0.03,))) for name in ("source_resistance", "sensor_lag"))
    search = told([record], best, [rival], word="ambiguous", base=base)
    findings = find(search)
    assert [x.id for x in findings.effects] == ["source_resistance", "sensor_lag"]
    assert [x.id for x in findings.added] == ["source_resistance"]
    assert "sensor_lag" not in {x.id for x in findings.model.blocks}
    result, _ = worked_out(findings, tmp_path)
    assert result["effects"][1]["rival_of"] == "source_resistance"
    assert [x["certain"] for x in result["effects"]] == [False, False]
    assert result["effects"][1]["rivals"][0]["id"] == "source_resistance"
    assert result["sentence"] == "These records cannot tell source resistance from sensor lag."


def test_nothing_missing_leaves_the_model_as_it_was(tmp_path: Path):
    findings = find(told([record_of()], word="no_gap"))
    result, measured = worked_out(findings, tmp_path)
    assert findings.model == load_model("paper")
    assert (result["effects"], result["recalibrated"]) == ([], {})
    assert measured.before.rms_um == pytest.approx(measured.after.rms_um, rel=1e-5)


def test_a_wrong_gain_and_offset_stand_under_recalibrated(tmp_path: Path):
    findings = find(told([record_of(gain=0.8, offset_um=1.5)], word="recalibrated"))
    result, _ = worked_out(findings, tmp_path)
    assert result["recalibrated"]["gain"]["after"] == pytest.approx(0.8, abs=1e-3)
    assert result["recalibrated"]["offset"]["after"] == pytest.approx(1.5, abs=0.05)
    assert result["effects"] == []
    assert findings.model.values()["calibration.gain"] == result["recalibrated"]["gain"]["after"]


@pytest.mark.slow
def test_records_of_one_bench_have_an_offset_each(tmp_path: Path):
    records = [record_of(offset_um=1.0), record_of(voltage_V=levels(seed=3), offset_um=-2.0, seed=8)]
    result, measured = worked_out(find(told(records, word="recalibrated")), tmp_path)
    assert result["where"] == []
    assert result["recalibrated"]["offset"]["after_by_record"] == pytest.approx([1.0, -2.0], abs=0.05)
    assert measured.after.rms_um == pytest.approx(NOISE_um, rel=0.15)


def test_places_name_the_record_where_there_are_several():
    lagging = {"source_resistance": {"time_constant_s": 0.03}}
    records = [record_of(voltage_V=levels(8.0)), record_of(effects=lagging, voltage_V=levels(seed=3))]
    findings = find(told(records, word="unexplained"))
    observations = findings.search.problem.observations
    readings = [x.measured_um for x in observations]
    measured = Measured(Gap(1.0, 1.0), Gap(1.0, 1.0), Gap(1.0, 1.0), NOISE_um, readings, readings, readings)
    assert {place["record"] for place in outcome(findings, measured)["where"]} == {1}


@pytest.mark.slow
def test_coarse_readings_are_named_and_simulated(tmp_path: Path):
    record = record_of()
    coarse = Record(record.time_s, record.voltage_V, 1.5 * np.round(record.displacement_um / 1.5))
    findings = find(told([coarse], word="no_gap", sensor_step_um=1.5))
    result, measured = worked_out(findings, tmp_path)
    assert result["verdict"] == "named"
    (effect,) = result["effects"]
    assert effect["parameters"]["step_um"]["value"] == 1.5
    assert effect["share_of_gap"] == 0.0
    assert effect["share_of_noise_floor"] == pytest.approx(1.0, abs=0.1)
    assert findings.model.values()["sensor_quantisation.step"] == 1.5
    steps = measured.after_um[0] / 1.5
    assert np.allclose(steps, np.round(steps), atol=1e-6)
    assert result["gap"]["noise_floor_um"] == pytest.approx(np.hypot(NOISE_um, 1.5 / np.sqrt(12.0)))


@pytest.mark.parametrize("lag_s", [0.0, 0.04])
def test_beside_an_effect_steps_that_outweigh_the_rest_are_simulated_and_alone_only_where_rounding_helps(lag_s: float):
    """The simulation is off by 0.15 of a step: the steps are most of the residual, and rounding makes it larger."""
    base = load_model("paper")
    record = record_of(effects={"source_resistance": {"time_constant_s": lag_s}} if lag_s else {})
    shaken = record.displacement_um + 0.15 * 1.5 * np.random.default_rng(8).standard_normal(len(record))
    coarse = Record(record.time_s, record.voltage_V, 1.5 * np.round(shaken / 1.5))
    best = hypothesis(base, [coarse], ("source_resistance", (lag_s,))) if lag_s else None
    findings = find(told([coarse], best, word="named" if lag_s else "no_gap", sensor_step_um=1.5))
    before = ["source_resistance"] if lag_s else []
    assert [x.id for x in findings.added] == [*before, "sensor_quantisation"]
    assert [x.id for x in findings.simulated] == ([x.id for x in findings.added] if lag_s else [])
    assert ("sensor_quantisation" in {x.id for x in findings.model.blocks}) is bool(lag_s)
    assert ("the corrected model is not rounded" in evidence(findings, findings.added[-1])) is not bool(lag_s)


def test_steps_that_the_noise_hides_are_said_and_not_simulated():
    record = record_of()
    rng = np.random.default_rng(4)
    shaken = record.displacement_um + 0.6 * rng.standard_normal(len(record))
    coarse = Record(record.time_s, record.voltage_V, 0.7 * np.round(shaken / 0.7))
    findings = find(told([coarse], word="no_gap", sensor_step_um=0.7))
    assert (findings.verdict, findings.effects) == ("no_gap", ())
    assert "sensor_quantisation" not in {x.id for x in findings.model.blocks}
    assert any("multiples of 0.7 µm" in text for text in warnings(findings))


def test_unusual_values_and_what_was_set_aside_are_said():
    record = record_of(effects={"saturation": {"scale_V": 60.0}})
    readings = record.displacement_um.copy()
    readings[[10, 50]] = np.nan
    lost = Record(record.time_s, record.voltage_V, readings)
    base = load_model("paper")
    search = told([lost], hypothesis(base, [lost], ("saturation, tanh", (60.0,))))
    observations = search.problem.observations[0]
    fewer = search.problem.observing([observations.without(np.arange(readings.size) == 100)])
    said = warnings(find(replace(search, found=replace(search.found, archive=replace(search.archive, problem=fewer)))))
    assert any("scale_V" in x and "unusual" in x and "poled" in x for x in said)
    assert f"2 of {readings.size} frames are lost and left out" in said
    assert "1 outlying reading was set aside, line 102" in said


def test_rows_that_were_put_in_are_said_and_lines_are_those_of_the_file():
    time_s = np.arange(600) / 30.0
    whole = record_of(effects={"saturation": {"scale_V": 60.0}}, voltage_V=25.0 + 20.0 * np.sin(3.0 * time_s))
    kept = np.delete(np.arange(600), [50, 51, 200])
    lost = completed(Record(time_s[kept], whole.voltage_V[kept], whole.displacement_um[kept]))
    search = told([lost], hypothesis(load_model("paper"), [lost], ("saturation, tanh", (60.0,))))
    observations = search.problem.observations[0]
    fewer = search.problem.observing([observations.without(np.isin(np.arange(600), [100, 300]))])
    found = replace(search, found=replace(search.found, archive=replace(search.archive, problem=fewer)))
    assert set_aside(found) == [SetAside(597, 0, (98, 297))]
    said = warnings(find(found))
    assert "2 outlying readings were set aside, lines 100, 299" in said
    assert "3 rows are missing; the voltage there is taken from those around" in said
    assert not any("frames are lost" in x for x in said)


def _playing() -> Record:
    """50 s of three tones, read from a device with backlash."""
    time_s = np.arange(1500) / 30.0
    tones = [a * np.sin(2.0 * np.pi * f * time_s) for a, f in ((9.0, 0.2), (6.0, 0.53), (4.0, 1.37))]
    return record_of(effects={"backlash": {"half_width_um": 0.6}}, voltage_V=20.0 + np.sum(tones, axis=0))


@pytest.mark.slow
def test_an_effect_is_the_same_whether_rows_are_missing_or_not():
    whole = _playing()
    kept = np.flatnonzero(np.random.default_rng(2).random(len(whole)) >= 0.02)
    found = diagnose(
        load_model("paper"), [Record(whole.time_s[kept], whole.voltage_V[kept], whole.displacement_um[kept])]
    )
    assert (found.verdict, [x.id for x in found.effects]) == ("named", ["backlash"])
    (plays,) = (x.parameters for x in found.model.blocks if x.id == "backlash")
    assert plays.half_width_um == pytest.approx(0.6, abs=0.01)


@pytest.mark.slow
def test_a_sensor_that_is_slower_than_the_rows_shows_no_effect_of_its_own():
    whole = _playing()
    taken_twice = replace(whole, displacement_um=whole.displacement_um[::2].repeat(2))
    found = diagnose(load_model("paper"), [taken_twice])
    assert (found.verdict, [x.id for x in found.effects]) == ("named", ["backlash"])
    assert any(x.startswith("750 readings: repeats of the one before") for x in warnings(found.findings))


@examples(max_examples=6)
@example(0, True, True)
@given(st.integers(0, 10_000), st.booleans(), st.booleans())
def test_what_is_played_to_an_fmu_is_what_was_simulated(seed: int, linear: bool, late: bool):
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.uniform(0.01, 0.2, 30))
    command_s = time_s + (rng.uniform(0.0, 1.0, 30) * 0.01 if late else 0.0)
    drive = Drive(time_s - time_s[0], command_s - time_s[0], rng.uniform(0.0, 50.0, 30), linear)
    record, read = playable(drive)
    assert np.array_equal(read.readings(record.time_s), drive.row_time_s)
    model = load_model("paper").with_block("source_resistance", time_constant_s=0.05)
    played = Simulator(Drive.of_rows(record.time_s, record.voltage_V, linear=linear)).run(model).reading_um
    # ramps are cut at other instants: a nanometre, as between the FMU and the kernel
    assert np.allclose(read.readings(played), Simulator(drive).run(model).reading_um, atol=1e-3, rtol=0.0)


@pytest.mark.slow
def test_untimed_rows_are_read_when_all_has_settled(tmp_path: Path):
    record = record_of("beam", voltage_V=np.concatenate([np.arange(0.0, 50.0), np.arange(50.0, 0.0, -1.0)]))
    untimed = Settings(untimed=True)
    played, read = playable(observe(record, untimed=True).drive)
    assert np.array_equal(played.voltage_V[read.places - 1], record.voltage_V)
    assert np.all(np.diff(played.time_s) >= 1.0)
    findings = find(told([record], word="unexplained", base=load_model("beam"), settings=untimed))
    result, measured = worked_out(findings, tmp_path)
    assert {place["axis"] for place in result["where"]} <= {"voltage", "direction"}
    above_zero = measured.after_um[0] - measured.after_um[0][0]
    assert above_zero == pytest.approx(record.voltage_V * above_zero[1], abs=1e-4)


LAGGING = {"source_resistance": {"time_constant_s": 0.06}}


@pytest.mark.parametrize("difference", [math.inf, -math.inf])
def test_a_rival_that_cannot_be_weighed_has_no_number(difference: float, tmp_path: Path) -> None:
    record = record_of(effects=LAGGING, voltage_V=np.repeat([0.0, 20.0, 40.0, 10.0], 25))
    best, rival = (hypothesis(load_model("paper"), [record], (x, (0.06,))) for x in ("source_resistance", "sensor_lag"))
    search = told([record], best, [rival], word="ambiguous")
    (effect,) = search.grades.effects
    rivals = tuple(replace(x, difference=difference) for x in effect.rivals)
    assert rivals
    grades = replace(search.grades, effects=(replace(effect, rivals=rivals, difference=math.inf),))
    findings = find(replace(search, grades=grades))
    measured = measure(findings.search, findings.model, findings.calibration, tmp_path / "model.fmu")
    result = outcome(findings, measured)
    told_again = json.loads(json.dumps(result, allow_nan=False))
    assert told_again["effects"][0]["rivals"][0]["delta_bic"] is None
    assert told_again["effects"][0]["delta_bic_without"] is None
    assert set(told_again["effects"][0]["weighed"]) == {"deviations", "log_ratio", "closed", "passed"}
    assert "too few readings to choose between them" in " ".join(
        " ".join(summary(findings, measured, result, tmp_path)).split()
    )
    assert "inf" not in report_page(findings, measured, result).split("<body")[1].replace("information", "").split()


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


# on either side of a linear plant a lag is the same
BASE, LAG_S = "beam", 0.03
SIDES = "source_resistance", "sensor_lag"


@pytest.fixture(scope="module")
def ambiguous() -> Findings:
    base = load_model(BASE)
    record = record_of(BASE, effects={SIDES[0]: {"time_constant_s": LAG_S}})
    best, rival = (hypothesis(base, [record], (name, (LAG_S,))) for name in SIDES)
    return find(told([record], best, [rival], word="ambiguous", base=base))


def test_a_rival_has_its_own_effect_refitted_and_not_that_of_the_leader(ambiguous: Findings):
    (rival,) = rival_models(ambiguous)
    assert rival.effects == (SIDES[1],)
    values = rival.model.values()
    assert values["sensor_lag.time_constant"] == pytest.approx(LAG_S, rel=0.1)
    assert "source_resistance.time_constant" not in values
    assert rival.model.valid == ambiguous.model.valid
    assert SIDES[0] in {x.id for x in ambiguous.model.blocks}


def test_a_rival_of_an_open_verdict_has_a_model_however_unlikely_it_is(ambiguous: Findings):
    reported = tuple(
        replace(x, contender=replace(x.contender, probability=1e-4)) if x.contender and x.contender.rival_of else x
        for x in ambiguous.effects
    )
    (rival,) = rival_models(replace(ambiguous, effects=reported))
    assert (rival.effects, rival.to_dict()["probability"]) == ((SIDES[1],), 1e-4)


@pytest.mark.parametrize(("share", "told"), [(1.0, "; as likely"), (0.5, "; less likely, but not ruled out")])
def test_a_rival_that_is_as_likely_is_not_called_less_so(ambiguous: Findings, share: float, told: str):
    lead, rival = ambiguous.effects
    entry = {"rivals": [{"id": lead.id, "delta_bic": 0.3}], "rival_of": lead.id}
    entry["probability"] = share * lead.probability
    assert _beside(ambiguous, rival, entry, 10.0) == told


def test_a_recalibrated_mode_that_rows_cannot_tell_from_its_aliases_says_so():
    base = load_model("paper")
    form = own_form(base)
    assert form is not None
    even = record_of(voltage_V=levels(8.0))
    apart = replace(even, time_s=even.time_s * (1.0 + 0.1 * even.time_s / even.time_s[-1]))
    values = (1.1, *(x.starts[0] for x in form.free[1:]))
    for record, is_said in ((even, True), (apart, False)):
        search = told([record], replace(Hypothesis(), own=Part(form, values)), word="recalibrated", refit=False)
        said = [x for x in warnings(find(search)) if x.startswith(form.free[0].name) and "rows a second" in x]
        assert bool(said) is is_said
        if said:
            assert said[0].startswith(
                "bending_modes.frequency_factor: at 30 rows a second, 114.81 Hz looks like 84.811, 95.189, 125.19 Hz"
            )


@pytest.mark.parametrize(("row_s", "low_s"), [(0.0, 0.001), (0.01, 0.001), (0.04, 0.002), (9.0, 0.01)])
def test_a_lag_is_not_sought_where_no_row_shows_it(row_s: float, low_s: float) -> None:
    model = (
        load_model("beam").with_block("sensor_lag", time_constant_s=0.01).with_block("transport_delay", delay_s=0.01)
    )
    form = own_form(model, row_s=row_s)
    assert form is not None
    lows = {x.name: x.low for x in form.free}
    assert lows["sensor_lag.time_constant_s"] == pytest.approx(low_s)
    # a delay that is far shorter than a row may be nought to the sensor, and costs nothing
    assert lows["transport_delay.delay_s"] == pytest.approx(0.001)


@pytest.mark.parametrize(("lowest_V", "times"), [(-5.0, 100.0), (0.0, 100.0), (5.0, 1.0)])
def test_a_lag_may_be_an_integrator_where_the_commands_let_one_stand_still(lowest_V: float, times: float) -> None:
    model = load_model("beam").with_block("plant_lag", time_constant_s=5.0)
    seen = observe(record_of(voltage_V=np.linspace(lowest_V, 20.0, 301)))
    form = record_search._kit(None, model, (), [seen]).own
    assert form is not None
    highs = {x.name: x.high for x in form.free}
    assert highs["plant_lag.time_constant_s"] == pytest.approx(min(times * 10.0, 500.0))


def test_a_number_of_the_model_at_the_end_of_its_range_is_said(tmp_path: Path):
    base = load_model("paper")
    form = own_form(base)
    assert form is not None
    record = record_of(voltage_V=levels(8.0))
    for factor, is_said in ((form.free[0].high, True), (1.1, False)):
        values = (factor, *(x.starts[0] for x in form.free[1:]))
        search = told([record], replace(Hypothesis(), own=Part(form, values)), word="recalibrated", refit=False)
        findings = find(search)
        (changed,) = [x for x in findings.changed if x.name == form.free[0].name]
        assert changed.at_end is is_said
        assert any(form.free[0].name in x and "end of its range" in x for x in warnings(findings)) is is_said
        measured = measure(search, findings.model, findings.calibration, tmp_path / "model.fmu")
        printed = " ".join(summary(findings, measured, outcome(findings, measured), tmp_path))
        assert ("end of its range" in " ".join(printed.split())) is is_said


@pytest.mark.parametrize("tells_apart", [True, False])
def test_a_command_that_distinguishes_nothing_is_not_written(ambiguous: Findings, tmp_path: Path, tells_apart: bool):
    fmu = tmp_path / "measured.fmu"
    gap = measure(ambiguous.search, ambiguous.model, ambiguous.calibration, fmu)
    proposal = Proposal("because", np.array([0.0, 1.0]), np.array([0.0, 9.0]), tells_apart)
    diagnosis = Diagnosis(ambiguous, gap, proposal, None, ("record.csv",), fmu.read_bytes())
    out = tmp_path / "out"
    out.mkdir()
    diagnosis.write(out, report=False)
    assert (out / "profile.csv").exists() is tells_apart
    assert ("profile.csv" in " ".join(diagnosis.summary(out))) is tells_apart
    assert json.loads((out / DIAGNOSIS).read_text())["next_experiment"]["profile"] == (
        "profile.csv" if tells_apart else None
    )


def test_what_the_corrected_fmu_has_for_other_quantities_is_said(ambiguous: Findings, tmp_path: Path):
    measured = measure(ambiguous.search, ambiguous.model, ambiguous.calibration, tmp_path / "model.fmu")
    result = outcome(ambiguous, measured)
    printed = [
        " ".join(" ".join(summary(ambiguous, measured, result | units, tmp_path)).split())
        for units in ({}, {"input_unit": "W", "unit": "K"})
    ]
    assert ["takes 1 V for 1 W and gives 1 µm for 1 K" in x for x in printed] == [False, True]


def test_a_verdict_that_is_not_open_leaves_none(ambiguous: Findings):
    search = ambiguous.search
    named = replace(search, verdict=replace(search.verdict, word="named"))
    assert rival_models(find(named)) == ()


def test_the_files_are_those_that_the_diagnosis_names_and_a_tuning_finds_them(ambiguous: Findings, tmp_path: Path):
    fmu = tmp_path / "measured.fmu"
    gap = measure(ambiguous.search, ambiguous.model, ambiguous.calibration, fmu)
    diagnosis = Diagnosis(ambiguous, gap, None, None, ("record.csv",), fmu.read_bytes())
    out = tmp_path / "out"
    out.mkdir()
    diagnosis.write(out, report=False)
    told_rivals = json.loads((out / DIAGNOSIS).read_text())["rival_models"]
    (told_rival,) = told_rivals
    named = {"effects": [SIDES[1]], "model": "rival-1.toml", "fmu": "rival-1.fmu"}
    assert told_rival == named | {"probability": told_rival["probability"]}
    printed = " ".join(" ".join(diagnosis.summary(out)).split())
    assert f"rival-1.toml has {SIDES[1]}" in printed
    assert {x.name for x in out.iterdir()} <= set(FILES)
    (found,) = diagnosed(out / "model.toml").rivals
    assert load_model(found.model) == rival_models(ambiguous)[0].model
    starts = {x.name: x.start for x in read_description(found.fmu).modelVariables}
    assert float(starts["sensor_lag.time_constant"]) == pytest.approx(LAG_S, rel=0.1)


CURVES = {
    "output_curve": {"quadratic_1_per_um": 0.002, "quintic_1_per_um4": 1e-7},
    "lens_distortion": {"quadratic_1_per_um": 0.002, "quintic_1_per_um4": 1e-7},
    "electrostriction": {"coefficient_um_per_V2": 0.001},
}


def read(model: Model, volts: np.ndarray) -> np.ndarray:
    return Simulator(Drive.of_rows(np.arange(volts.size) / 30.0, volts, linear=False)).run(model).reading_um


@pytest.mark.parametrize("effect", CURVES)
def test_inside_nothing_changes_and_beyond_it_runs_on_along_a_line(effect: str) -> None:
    record = record_of(voltage_V=levels(30.0))
    curved = load_model("beam").with_block(effect, **CURVES[effect])
    valid = ValidRange(float(record.voltage_V.min()), float(record.voltage_V.max()), 30.0)
    straight = straight_beyond(curved, [effect], valid, [observe(record)])
    assert read(straight, record.voltage_V) == pytest.approx(read(curved, record.voltage_V), rel=1e-12, abs=1e-12)
    at = [float(read(straight, np.full(200, x * valid.highest_V))[-1]) for x in (2.0, 3.0, 4.0)]
    assert at[2] - at[1] == pytest.approx(at[1] - at[0], rel=1e-6)
    wild = [float(read(curved, np.full(200, x * valid.highest_V))[-1]) for x in (2.0, 3.0, 4.0)]
    assert wild[2] - wild[1] > 1.02 * (wild[1] - wild[0])


def test_other_blocks_stay_as_they_are() -> None:
    model = load_model("paper").with_block("output_curve", cubic_1_per_um2=1e-4)
    assert straight_beyond(model, ["source_resistance"], ValidRange(0.0, 50.0, 1.0), []) == model


def test_readings_at_the_end_of_the_range_are_said():
    swing_V = 25.0 + 20.0 * np.sin(0.2 * np.arange(900) / 30.0 * 2.0 * np.pi)
    record = record_of(voltage_V=swing_V)
    level = float(np.quantile(record.displacement_um, 0.8))
    cut = Record(record.time_s, record.voltage_V, np.minimum(record.displacement_um, level))
    (said,) = [x for x in warnings(find(told([cut], word="unexplained"))) if "end of its range" in x]
    assert said.startswith(f"{int(np.sum(cut.displacement_um == level))} readings stand at ")
    assert not any("end of its range" in x for x in warnings(find(told([record], word="no_gap"))))
