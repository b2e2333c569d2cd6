"""What is said of all rows and records, where the search saw a part of them or an effect belongs to one of them."""

import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from reported_diagnosis import NOISE_um, hypothesis, levels, record_of, told

from bender_discrepancy.conclusion.diagnosis_json import outcome
from bender_discrepancy.conclusion.findings import Findings, RecalibratedNumber, find
from bender_discrepancy.conclusion.measurement.gap import Measured, measure
from bender_discrepancy.conclusion.notes import more_than_noise, row_of_file
from bender_discrepancy.conclusion.sentences import gap_sentence, headline
from bender_discrepancy.report.summary import summary
from bender_discrepancy.workflow import measured_through_fmu, next_best, refuted
from bender_effects.form import growth, monotone
from bender_inference.fitting.hypothesis import Hypothesis, Part
from bender_inference.search.archive import Archive
from bender_inference.search.full_record import FullRecordCheck, judged_on_full_record
from bender_inference.search.judgement.grades import grade
from bender_inference.search.judgement.rules import RULES, ended_without_answer
from bender_inference.search.judgement.verdict import PARTLY, decide
from bender_inference.search.result import SearchResult
from bender_plant.model import load_model

PAPER = load_model("paper")
LAG = ("source_resistance", (0.06,))
LAGGING = {"source_resistance": {"time_constant_s": 0.06}}


@pytest.fixture(scope="module")
def lagging() -> SearchResult:
    record = record_of(effects=LAGGING)
    return told([record], hypothesis(PAPER, [record], LAG))


@pytest.mark.parametrize(
    ("left", "word", "grades", "why"),
    [(1.2, "named", "certain", "noise floor"), (2.5, "named", "certain", PARTLY), (9.0, "likely", "likely", "whole")],
)
def test_the_verdict_on_a_long_record_its_reason_and_its_grades_say_one_thing(
    lagging: SearchResult, left: float, word: str, grades: str, why: str
) -> None:
    """Of a gap of twenty times the noise, 1.2, 2.5 or 9 times it is left on all rows."""
    verdict = decide(lagging.found, lagging.grades, RULES)
    assert (verdict.word, verdict.complete) == ("named", True)
    check = FullRecordCheck(lagging.found, 20.0 * NOISE_um, left * NOISE_um)
    lowered, final = judged_on_full_record(lagging.grades, verdict, check, RULES)
    assert (final.word, [x.grade for x in lowered.effects]) == (word, [grades])
    assert why in final.reason
    assert final.complete == (left < 2.0)


@pytest.mark.parametrize(("deviations", "word"), [(0.2, "ambiguous"), (1.0, "ambiguous"), (2.5, "likely")])
def test_what_a_rival_predicts_as_well_is_open_however_probable(deviations: float, word: str) -> None:
    """Structure is left, and the leading effect is more probable than not: a tie is no verdict on it."""
    record = record_of(effects=LAGGING)
    lags = (hypothesis(PAPER, [record], (x, (0.06,))) for x in ("source_resistance", "sensor_lag"))
    search = told([record], next(lags), list(lags))
    (effect,) = search.grades.effects
    rival = replace(effect.rivals[0], deviations=deviations, reach="predicts as well")
    open_ = replace(effect, grade="likely", probability=0.7, rivals=(rival,))
    found = decide(search.found, replace(search.grades, effects=(open_,), complete=False), RULES)
    assert found.word == word
    assert rival.id in found.reason


def test_rows_that_a_fit_used_are_not_reported_on(lagging: SearchResult) -> None:
    (seen,) = lagging.problem.observations
    rows = np.flatnonzero(seen.usable)[::3]
    kept = seen.fitted_on(rows)
    assert not kept.reporting[rows].any()
    assert np.array_equal(np.delete(kept.reporting, rows), np.delete(seen.reporting, rows))


def test_an_offset_of_another_record_than_the_first_is_told() -> None:
    records = [record_of(), record_of(voltage_V=levels(seed=3), seed=8, offset_um=5.0)]
    findings = find(told(records, word="recalibrated"))
    (offset,) = findings.recalibrated
    assert (offset.name, offset.most_changed) == ("offset", 1)
    assert offset.afters == pytest.approx((0.0, 5.0), abs=0.05)
    assert "the offset is 5" in headline(findings, None)  # pyright: ignore[reportArgumentType]
    assert "in record 2" in headline(findings, None)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("afters", "stds", "is_significant", "most"),
    [((0.0, 5.0), (0.1, 0.1), True, 1), ((0.0, 0.4), (0.1, 0.1), False, 1), ((3.0, 5.0), (0.1, 2.0), True, 0)],
)
def test_a_number_changed_where_it_did_so_in_one_record(
    afters: tuple[float, ...], stds: tuple[float, ...], is_significant: bool, most: int
) -> None:
    number = RecalibratedNumber("offset", 0.0, afters[0], stds[0], "um", afters, stds)
    assert (number.is_significant, number.most_changed) == (is_significant, most)


def test_an_effect_that_one_record_lacks_has_not_ended_without_an_answer() -> None:
    form = monotone("thermal_drift", growth("amplitude_um", 0.1, 5.0), 60.0)[0].for_each_of(2)
    shortest_s = form.free[1].low
    assert not ended_without_answer(Part(form, (1.0, 20.0, 0.0, shortest_s)))
    assert ended_without_answer(Part(form, (1.0, shortest_s, 0.0, shortest_s)))
    assert ended_without_answer(Part(form.alone(), (1.0, shortest_s)))


def test_a_drift_of_one_record_alone_is_told_by_that_record() -> None:
    drift = {"thermal_drift": {"amplitude_um": 1.0, "time_constant_s": 5.0}}
    beam = load_model("beam")
    records = [record_of("beam", drift, levels(30.0)), record_of("beam", None, levels(30.0, seed=4), seed=9)]
    form = next(x.form for x in hypothesis(beam, records[:1], ("thermal_drift", (1.0, 5.0))).parts).for_each_of(2)
    own = Hypothesis().plus(form, (1.0, 5.0, 0.01, 5.0))
    (found,) = told(records, own, base=beam).grades.effects
    assert found.grade == "certain"


def test_what_belongs_to_the_record_alone_closes_the_gap_without_a_corrected_model(tmp_path: Path) -> None:
    record = record_of("beam", {"thermal_drift": {"amplitude_um": 1.0, "time_constant_s": 5.0}}, levels(30.0))
    beam = load_model("beam")
    findings = find(told([record], hypothesis(beam, [record], ("thermal_drift", (1.0, 5.0))), base=beam))
    measured = measure(findings.search, findings.model, findings.calibration, tmp_path / "model.fmu")
    assert (findings.is_corrected, findings.explains_more) == (False, True)
    sentence = gap_sentence(findings, measured)
    assert "the gap falls from" in sentence
    assert "with what belongs to the record" in sentence
    told_lines = " ".join(" ".join(summary(findings, measured, outcome(findings, measured), tmp_path)).split())
    assert "with what belongs to the record" in told_lines
    assert "of the gap: of the mean square" in told_lines
    assert more_than_noise(findings, measured) == []
    loud = replace(measured, after=replace(measured.after, rms_um=5.0 * measured.floor_um))
    assert len(more_than_noise(findings, loud)) == 1


def test_what_a_witness_shows_stands_on_a_single_step() -> None:
    volts = np.where(np.arange(300) < 30, 0.0, 30.0)
    record = record_of("beam", {"slew_limit": {"slew_rate_V_per_s": 60.0}}, volts)
    beam = load_model("beam")
    own = hypothesis(beam, [record], ("slew_limit", (60.0,)))
    shown = replace(own, parts=tuple(replace(x, form=replace(x.form, shown=True)) for x in own.parts))
    for best, word in ((own, "likely"), (shown, "certain")):
        (found,) = grade(told([record], best, base=beam).found, RULES).effects
        assert found.grade == word


def test_a_coarse_sensor_does_not_make_every_effect_one_that_a_block_alone_shows() -> None:
    """Where readings are coarse, the residual beyond the steps is compared with its like, not with the steps."""
    step_um = 2.0
    record = record_of("beam", {"creep": {"gains": (0.02,), "time_constants_s": (2.0,)}}, levels(60.0))
    coarse = replace(record, displacement_um=step_um * np.round(record.displacement_um / step_um))
    beam = load_model("beam")
    best = hypothesis(beam, [coarse], ("1 relaxation", (0.02, 2.0)))
    (found,) = told([coarse], best, base=beam, sensor_step_um=step_um).grades.effects
    assert found.grade == "certain"


def test_a_row_is_counted_as_the_file_counts_it() -> None:
    record = record_of()
    made_up = np.zeros(len(record), dtype=np.bool_)
    made_up[[10, 11, 40]] = True
    with_gaps = replace(record, made_up=made_up)
    assert [row_of_file(with_gaps, x) for x in (9, 12, 39, 41, len(record) - 1)] == [9, 10, 37, 38, len(record) - 4]
    assert row_of_file(record, 41) == 41
    assert row_of_file(replace(record, made_up=np.ones(len(record), dtype=np.bool_)), 0) == 0


def test_a_fit_counts_as_it_does_now_when_readings_were_set_aside_since(lagging: SearchResult) -> None:
    archive, best = lagging.archive, lagging.best
    assert archive.current(best) is best
    renewed = replace(best, training_square=0.5 * best.training_square)
    later = Archive(archive.problem, archive.noise_um, [renewed if x is best else x for x in archive.fits])
    assert later.current(best) is renewed
    lost = Archive(archive.problem, archive.noise_um, [])
    again = lost.current(best)
    assert again.hypothesis is best.hypothesis
    assert lost.fits == [again]


def test_why_effects_are_removed_names_what_leaves_less(lagging: SearchResult, tmp_path: Path) -> None:
    findings = find(lagging)
    gap = measure(lagging, findings.model, findings.calibration, tmp_path / "model.fmu")
    assert refuted(lagging, gap) == ""
    worse = replace(gap, after=replace(gap.after, rms_um=9.0), recalibrated=replace(gap.recalibrated, rms_um=4.0))
    as_given = replace(worse, before=replace(gap.before, rms_um=3.0))
    assert "as given 3 µm" in refuted(lagging, as_given)
    alone = replace(worse, before=replace(gap.before, rms_um=6.0))
    assert "with calibration alone 4 µm" in refuted(lagging, alone)
    own_numbers = lagging.with_search(replace(lagging.found, best=lagging.found.base))
    assert "numbers of its own" in refuted(own_numbers, alone)


def test_where_held_out_readings_contradict_the_best_the_next_best_is_told_as_likely() -> None:
    record = record_of(effects=LAGGING)
    wrong, right = (hypothesis(PAPER, [record], x) for x in (("dead_zone", (0.1,)), LAG))
    search = told([record], wrong, [right])
    measured = partial(measured_through_fmu, names=["record"], tell=lambda _: None, box=None, driver=None)
    found, (findings, gap, content) = next_best(search, "why", ["record"], measured)
    assert found.best.hypothesis.effects == ("source_resistance",)
    assert [x.grade for x in found.grades.effects] == ["likely"]
    assert (findings.verdict, findings.search) == ("likely", found)
    assert "held-out readings contradict a model with dead_zone and nothing else missing" in found.verdict.reason
    assert gap.after.rms_um < 0.2 * gap.recalibrated.rms_um
    assert content


def test_where_they_contradict_all_of_them_nothing_is_named() -> None:
    record = record_of(effects=LAGGING)
    wrong, worse = (hypothesis(PAPER, [record], x) for x in (("dead_zone", (0.1,)), ("dead_zone", (0.2,))))
    search = told([record], wrong, [worse])
    found, _ = next_best(
        search,
        "why",
        ["record"],
        partial(measured_through_fmu, names=["record"], tell=lambda _: None, box=None, driver=None),
    )
    assert found.best.hypothesis.effects == ()
    assert (found.verdict.word, found.verdict.reason) == ("unexplained", "why")


def test_effects_that_are_removed_where_noise_alone_is_left_make_no_gap() -> None:
    record = record_of()
    search = told([record], hypothesis(PAPER, [record], LAG))
    assert search.without_effects("why").verdict.word == "no_gap"


def test_what_held_out_readings_refute_is_no_rival_of_what_takes_its_place() -> None:
    beam = load_model("beam")
    record = record_of("beam", effects={"sensor_lag": {"time_constant_s": 0.06}})
    refuted, other = (hypothesis(beam, [record], (x, (0.06,))) for x in ("source_resistance", "sensor_lag"))
    search = told([record], refuted, [other], base=beam)
    assert [x.id for x in search.grades.effects[0].near_rivals] == ["sensor_lag"]
    (found, *_) = search.next_best()
    assert found.best.hypothesis.effects == ("sensor_lag",)
    assert found.grades.effects[0].open_rivals == ()
    assert found.verdict.word != "ambiguous"


def test_where_held_out_readings_show_no_gap_no_next_best_is_told() -> None:
    record = record_of(effects=LAGGING)
    wrong, right = (hypothesis(PAPER, [record], x) for x in (("dead_zone", (0.1,)), LAG))
    search = told([record], wrong, [right])

    def without_a_gap(found: SearchResult) -> tuple[Findings, Measured, bytes]:
        findings, gap, content = measured_through_fmu(found, ["record"], lambda _: None, None, None)
        assert not gap.is_worse
        return findings, replace(gap, closed=(math.nan, math.inf)), content

    found, _ = next_best(search, "why", ["record"], without_a_gap)
    assert found.best.hypothesis.effects == ()
