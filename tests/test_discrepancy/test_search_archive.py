"""The archive, the moves, the rules and the grades of a search, on records of which everything is known."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import NOISE_um, hypothesis, levels, record_of, told

from bender_discrepancy.record_search import search_records
from bender_identify.first_model.structures import Structure
from bender_inference.candidates import candidate_forms
from bender_inference.fitting.fit_problem import problem_of
from bender_inference.fitting.hypothesis import Hypothesis, Part
from bender_inference.fitting.output_error import Fitted, fit, judge
from bender_inference.fitting.own_numbers import first_mode_Hz, own_form, part_without_named
from bender_inference.records.observations import hardly_steps, observe
from bender_inference.records.roles import blocks_of
from bender_inference.search import search as search_module
from bender_inference.search import transfer
from bender_inference.search.archive import Archive, left_square
from bender_inference.search.explore import explore_beside_each
from bender_inference.search.judgement.grades import Graded, grade
from bender_inference.search.judgement.rules import RULES, Rules, above_floor_um2
from bender_inference.search.judgement.verdict import decide
from bender_inference.search.moves import (
    ADJUST,
    AGAINST,
    BESIDE,
    GROW,
    POLISH,
    Catalogue,
    Kit,
    Scan,
    Start,
    aliases,
    restructure,
    swap,
)
from bender_inference.search.result import SearchResult
from bender_inference.search.search import Searched, improved, leading_fits, parsimonious, with_named_numbers
from bender_inference.settings import Settings
from bender_loop.records.record import Record, read_record
from bender_plant.model import load_model, model_from_table
from bender_proving.devices.record import draw

PAPER = load_model("paper")
LAG = ("source_resistance", (0.06,))
HUM = ("periodic_disturbance", (0.5, 0.0, 1.3))
LAGGING = {"source_resistance": {"time_constant_s": 0.06}}


def lagging(*rivals: tuple[str, tuple[float, ...]], best: Sequence[tuple[str, tuple[float, ...]]] = (LAG,)):
    record = record_of(effects=LAGGING)
    return told([record], hypothesis(PAPER, [record], *best), [hypothesis(PAPER, [record], x) for x in rivals])


@cache
def lagging_grades() -> tuple[Graded, ...]:
    return grade(lagging(("sensor_lag", (0.06,))).found, RULES).effects


@pytest.fixture(scope="module")
def search() -> SearchResult:
    return lagging(("sensor_lag", (0.06,)), ("thermal_drift", (0.5, 5.0)))


def catalogue_of(found: SearchResult) -> Catalogue:
    forms = tuple(candidate_forms(PAPER, found.problem.observations))
    return Catalogue((Kit(None, forms, own_form(PAPER)),))


def test_a_fit_is_made_once(search: SearchResult) -> None:
    archive = Archive(search.problem, NOISE_um)
    start = search.best.hypothesis
    first = archive.fit(start)
    work, count = archive.problem.work_substeps, len(archive.fits)
    assert archive.fit(start) is first
    assert (archive.problem.work_substeps, len(archive.fits)) == (work, count)
    forms = catalogue_of(search).kits[0].forms
    assert first is not None
    assert archive.not_scanned(first, forms) == list(forms)
    assert archive.not_scanned(first, forms) == []


def test_forms_are_scanned_again_once_readings_are_set_aside() -> None:
    record = record_of(effects=LAGGING)
    read = record.displacement_um.copy()
    read[[20, 45]] += 400.0
    told_of = told([replace(record, displacement_um=read)], hypothesis(PAPER, [record], LAG))
    archive, forms = Archive(told_of.problem), catalogue_of(told_of).kits[0].forms[:3]
    leader = archive.fit(told_of.best.hypothesis)
    assert leader is not None
    archive.not_scanned(leader, forms)
    again = archive.set_aside(leader)
    assert not np.any(archive.problem.observations[0].usable[[20, 45]])
    assert archive.not_scanned(again, forms) == list(forms)


def test_blocks_are_predicted_as_fits_without_them_predict_them(search: SearchResult) -> None:
    """Oracle: the record without a block, fitted anew."""
    archive = search.archive
    found = archive.prediction(search.best)
    assert found is not None
    (x,) = search.problem.observations
    blocks = blocks_of(x.usable)
    counted = np.unique(blocks[x.searched])
    assert found.blocks.size == counted.size == 17
    for place, block in [(k, counted[k]) for k in (3, 8, 14)]:
        own = blocks == block
        without = problem_of(PAPER, (replace(x, held_out=own, reported=own & x.reported),))
        again = fit(without, search.best.hypothesis, kept=False)
        assert again is not None
        others = without.observations[0].training
        assert np.array_equal(others, x.usable & ~own) or others.sum() >= x.searched.sum() - own.sum()
        assert found.blocks[place] == pytest.approx(float(np.sum(again.residuals[0][own & x.searched] ** 2)), rel=0.03)
    assert found.square == pytest.approx(float(found.blocks.sum()))
    # what is predicted is never less than what a fit to all leaves
    assert found.square >= 0.99 * left_square(search.best)


def test_the_archive_prefers_what_is_there(search: SearchResult) -> None:
    archive = search.archive
    assert archive.best(archive.fits) is search.best
    against = archive.difference(search.best, search.found.base)
    assert against.deviations > RULES.certain_deviations
    assert against.ratio > 10.0
    assert archive.difference(search.found.base, search.best).deviations < 0.0
    assert archive.by_square()[0] is search.best
    assert archive.bare(None) is search.found.base


def test_whether_an_effect_is_there_is_asked_of_all_its_forms() -> None:
    """A plainer form is the best hypothesis; the case for the effect is that of the form that predicts best."""
    plays = {"thresholds_V": (2.0, 5.0, 10.0, 18.0), "weights_um_per_V": (0.01, 0.01, 0.01, 0.01)}
    record = record_of("beam", {"rate_independent_hysteresis": plays})
    plain, flexible, lag = (
        hypothesis(load_model("beam"), [record], x)
        for x in (("Bouc-Wen", (0.02, 5.0, 0.0)), ("10 plays", (0.004,) * 10), LAG)
    )

    def deviations(*others: Hypothesis) -> float:
        found = told([record], plain, [lag, *others], base=load_model("beam"))
        (graded,) = grade(Searched(found.archive, found.found.base, found.best), RULES).effects
        return graded.case.deviations

    assert deviations(flexible) > deviations()


def test_what_is_no_model_is_no_rival() -> None:
    """A rival whose reading has a gain beyond all bounds fits the rows, but no model can be written of it."""
    found = lagging(("sensor_lag", (0.06,)))
    rivals = [x.id for x in grade(Searched(found.archive, found.found.base, found.best), RULES).effects[0].rivals]
    assert rivals == ["sensor_lag"]
    at = next(k for k, x in enumerate(found.archive.fits) if x.hypothesis.effects == ("sensor_lag",))
    wild = found.archive.fits[at]
    found.archive.fits[at] = replace(wild, calibration=replace(wild.calibration, gain=1e6))
    assert grade(Searched(found.archive, found.found.base, found.best), RULES).effects[0].rivals == ()


@pytest.mark.parametrize(("elsewhere", "chosen"), [(0.5, "source_resistance"), (5.0, "sensor_lag")])
def test_what_is_worse_elsewhere_than_no_effect_is_not_carried(
    elsewhere: float, chosen: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = lagging(("sensor_lag", (0.06,)), ("thermal_drift", (0.5, 5.0)))
    squares = {"": 1.0, "source_resistance": elsewhere, "sensor_lag": 0.6, "thermal_drift": 0.9}
    monkeypatch.setattr(transfer, "transfer_square", lambda _, x: squares["".join(x.hypothesis.effects)])
    assert transfer.best_carried(found.archive, RULES, found.best).hypothesis.effects == (chosen,)


def test_the_simplest_is_chosen_that_predicts_as_well() -> None:
    record = record_of(effects=LAGGING)
    both = hypothesis(PAPER, [record], LAG, HUM)
    found = told([record], both, [hypothesis(PAPER, [record], LAG)])
    assert found.best.hypothesis.effects == ("source_resistance", "periodic_disturbance")
    assert parsimonious(found.archive, RULES).hypothesis.effects == ("source_resistance",)
    assert parsimonious(told([record_of()], both).archive, RULES).hypothesis.effects == ()


def test_a_curve_is_told_without_the_loop_beside_it() -> None:
    """The loop follows the noise a little more closely: of both, which are one curve, the plainer one is meant."""
    record = record_of(effects={"electrostriction": {"coefficient_um_per_V2": 0.002}}, seed=4)
    curve = hypothesis(PAPER, [record], ("electrostriction", (0.002,)))
    form = next(x for x in candidate_forms(PAPER, [observe(record)]) if x.name == "Bouc-Wen beside a curve")
    starts = tuple(x.starts[0] if x.starts else 0.0 for x in form.free)
    loop = told([record], Hypothesis().plus(form, starts), [curve])
    assert curve.effects == (form.beside,)
    (plain,) = (x for x in loop.archive.fits if x.hypothesis.effects == curve.effects)
    assert RULES.is_preferred(loop.archive, loop.best, plain)
    assert parsimonious(loop.archive, RULES).hypothesis.effects == curve.effects


def test_what_is_there_is_certain_and_named(search: SearchResult) -> None:
    grades = grade(search.found, RULES)
    (only,) = grades.effects
    assert (only.id, only.grade) == ("source_resistance", "certain")
    assert only.probability > 0.9
    assert not only.open_rivals
    assert grades.complete
    assert grades.closed > 0.99
    assert decide(search.found, grades, RULES).word == "named"


def test_what_is_not_there_is_not_certain() -> None:
    found = lagging(LAG, best=(("thermal_drift", (0.5, 5.0)),))
    grades = grade(found.found, RULES)
    (only,) = grades.effects
    assert only.grade != "certain"
    assert [x.id for x in only.open_rivals] == ["source_resistance"]
    assert decide(found.found, grades, RULES).word != "named"


@given(deviations=st.floats(-5.0, 20.0))
def test_a_rival_two_standard_errors_behind_is_less_probable_by_the_factor_e(deviations: float) -> None:
    (only,) = lagging_grades()
    rival = replace(only.rivals[0], deviations=deviations)
    further = replace(rival, deviations=max(deviations, 0.0) + 2.0)
    assert only.probability_of(further) == pytest.approx(only.probability_of(rival) / np.e)
    assert only.probability_of(rival) <= min(only.probability, 1.0 - only.probability)


def test_an_effect_that_is_not_there_is_exchanged_for_the_one_that_is() -> None:
    found = lagging(LAG, best=(("thermal_drift", (0.5, 5.0)),))
    better = improved(found.archive, catalogue_of(found), RULES, found.best, (swap,))
    assert better.hypothesis.effects == ("source_resistance",)
    nothing = found.found.base
    assert improved(found.archive, catalogue_of(found), RULES, nothing, (swap,)) is nothing


def test_effects_are_tried_in_every_other_structure_that_has_their_forms(search: SearchResult) -> None:
    forms = catalogue_of(search).kits[0].forms
    beam = load_model("beam")
    kits = (Kit(None, forms), Kit(PAPER, forms), Kit(beam, tuple(x for x in forms if x.effect != "source_resistance")))
    starts = restructure(search.archive, Catalogue(kits), search.best)
    assert [x.hypothesis.structure for x in starts if isinstance(x, Start)] == [PAPER]
    (start,) = starts
    assert isinstance(start, Start)
    assert (start.hypothesis.effects, start.hypothesis.values()) == (
        search.best.hypothesis.effects,
        search.best.hypothesis.values(),
    )


@pytest.mark.parametrize(("gain", "word"), [(1.0, "no_gap"), (0.9, "recalibrated")])
def test_without_effects_the_verdict_is_what_calibration_changes(gain: float, word: str) -> None:
    found = told([record_of(gain=gain)])
    grades = grade(found.found, RULES)
    assert (grades.effects, grades.complete) == ((), True)
    assert decide(found.found, grades, RULES).word == word
    left = told([record_of(effects=LAGGING)])
    assert decide(left.found, grade(left.found, RULES), RULES).word == "unexplained"


@pytest.mark.parametrize(
    ("grades", "rivals", "complete", "word"),
    [
        (("certain", "certain"), (), True, "named"),
        (("certain", "certain"), (), False, "named"),
        (("certain", "likely"), (), True, "likely"),
        (("likely",), (), False, "likely"),
        (("likely",), ("sensor_lag",), True, "ambiguous"),
        (("likely",), ("sensor_lag",), False, "likely"),
        (("possible",), ("sensor_lag",), False, "ambiguous"),
        (("possible",), (), False, "likely"),
    ],
)
def test_grades_make_the_verdict(
    grades: tuple, rivals: tuple[str, ...], complete: bool, word: str, search: SearchResult
) -> None:
    (model,) = search.grades.effects
    chance = {"certain": 0.99, "likely": 0.7, "possible": 0.2}
    rival = next(x for x in model.rivals if x.id == "sensor_lag")
    open_ = tuple(replace(rival, reach="predicts as well") for _ in rivals)
    effects = tuple(replace(model, index=k, grade=x, probability=chance[x], rivals=open_) for k, x in enumerate(grades))
    verdict = decide(search.found, replace(search.grades, effects=effects, complete=complete), RULES)
    assert (verdict.word, verdict.complete) == (word, complete)
    if word == "ambiguous":
        assert "sensor_lag" in verdict.reason


@pytest.mark.parametrize("best", [(LAG,), (LAG, HUM), (("tip_mass", (1.1,)), ("transport_delay", (0.02,)))])
def test_no_move_proposes_an_effect_twice(best: Sequence[tuple[str, tuple[float, ...]]]) -> None:
    found = lagging(("sensor_lag", (0.06,)), best=best)
    catalogue = catalogue_of(found)
    for move in {*GROW, *BESIDE, *ADJUST, *POLISH, *AGAINST}:
        for x in move(found.archive, catalogue, found.best):
            proposed = [x.hypothesis] if isinstance(x, Start) else _scanned(x)
            for one in proposed:
                assert len(set(one.effects)) == len(one.effects) <= catalogue.most


def test_the_models_own_frequency_is_tried_at_its_aliases(search: SearchResult) -> None:
    """Rows on an even grid show a ringing at all of them alike: a fit ends in the valley where it began."""
    own = own_form(PAPER)
    assert own is not None
    place = next(k for k, x in enumerate(own.free) if x.name == "bending_modes.frequency_factor")
    fitted = search.archive.fit(search.best.hypothesis.freeing(own, tuple(x.starts[0] for x in own.free)))
    assert fitted is not None
    first_Hz = first_mode_Hz(PAPER)
    assert first_Hz is not None
    (x,) = search.problem.observations
    rate_Hz = 1.0 / float(np.median(np.diff(x.time_s)))
    proposed = aliases(search.archive, catalogue_of(search), fitted)
    factors = [y.hypothesis.values()[1 + place] for y in proposed if isinstance(y, Start)]
    here_Hz = first_Hz * fitted.hypothesis.values()[1 + place]
    assert factors
    for factor in factors:
        assert own.free[place].low < factor <= own.free[place].high
        turned = np.array([first_Hz * factor - here_Hz, first_Hz * factor + here_Hz]) / rate_Hz
        assert np.min(np.abs(turned - np.round(turned))) < 1e-9


def _scanned(scan: Scan) -> list[Hypothesis]:
    starts = [tuple(y.starts[0] if y.starts else y.high for y in x.free) for x in scan.forms]
    return [scan.parent.hypothesis.plus(x, y) for x, y in zip(scan.forms, starts, strict=True)]


@given(st.floats(0.5, 0.9999), st.floats(0.0, 0.99))
def test_a_stricter_confidence_asks_for_more(confidence: float, part: float) -> None:
    lower = Rules(confidence=confidence * part)
    assert Rules(confidence=confidence).certain_deviations >= lower.certain_deviations
    assert Rules(confidence=confidence).very_strong >= lower.very_strong


@given(st.floats(0.0, 3.0), st.floats(0.0, 3.0))
@examples(max_examples=20)
def test_less_left_closes_more_and_is_small_sooner(one: float, other: float) -> None:
    found = CLOSING
    archive, base, rows = found.archive, found.found.base, found.problem.observations[0].usable.size
    less, more = (
        replace(found.best, residuals=(NOISE_um * np.sqrt(1.0 + x) * np.ones(rows),)) for x in sorted((one, other))
    )
    shares = [RULES.closed_share(archive, base, x) for x in (less, more)]
    assert shares[0] >= shares[1]
    assert above_floor_um2(archive, less) <= above_floor_um2(archive, more)
    assert RULES.is_small(archive, base, less) or not RULES.is_small(archive, base, more)


CLOSING = lagging()


def leaving(*levels_um: float) -> list[Fitted]:
    """Return hypotheses of one effect that leave the same in every row, so much each."""
    rows = CLOSING.problem.observations[0].usable.size
    return [replace(CLOSING.best, residuals=(level_um * np.ones(rows),)) for level_um in levels_um]


@pytest.mark.parametrize(
    ("without_um", "left_um", "is_material"),
    [(2.0, 1.5, False), (2.0, 1.4, True), (9.0, 8.75, False), (9.0, 8.7, True), (2.0, 2.5, False), (0.08, 0.06, False)],
)
def test_what_is_material_removes_half_of_the_rest_or_a_twentieth_of_the_gap(
    without_um: float, left_um: float, is_material: bool
) -> None:
    base, without, fitted = leaving(10.0, without_um, left_um)
    assert RULES.is_material(CLOSING.archive, base, without, fitted) is is_material


@pytest.mark.parametrize(("left_um", "is_half_way"), [(1.69, False), (1.68, True)])
def test_two_steps_of_half_the_way_are_material(left_um: float, is_half_way: bool) -> None:
    base, without, one, two = leaving(10.0, 2.0, left_um, left_um**2 / 2.0)
    assert RULES.is_half_way(CLOSING.archive, without, one) is is_half_way
    assert not RULES.is_material(CLOSING.archive, base, without, one)
    assert RULES.is_material(CLOSING.archive, base, without, two) is is_half_way


@pytest.mark.parametrize(
    ("without_um", "left_um", "of_size"),
    [(0.15, 0.13, True), (0.15, 0.1, False), (0.11, 0.06, True), (1.1, 0.1, False)],
)
def test_the_last_percent_is_one_of_the_size_of_the_gap(without_um: float, left_um: float, of_size: bool) -> None:
    base, without, fitted = leaving(10.0, without_um, left_um)
    assert RULES.is_of_last_percent(CLOSING.archive, base, without, fitted) is of_size


def test_what_belongs_to_the_record_must_remove_most_of_the_rest(search: SearchResult) -> None:
    """A drift of a tenth of the gap is no effect of the device, and does not stand beside one."""
    record = record_of(effects=LAGGING, voltage_V=levels(20.0))
    bench = problem_of(PAPER, (observe(record),))
    start, lag = judge(bench, Hypothesis()), fit(bench, hypothesis(PAPER, [record], LAG))
    drift = fit(bench, hypothesis(PAPER, [record], LAG, ("thermal_drift", (0.1, 5.0))))
    assert start is not None
    assert lag is not None
    assert drift is not None
    archive = Archive(bench, NOISE_um)
    archive.add([start, lag, drift])
    assert RULES.is_material(archive, start, start, lag)
    assert not RULES.is_material(archive, start, lag, drift)


@pytest.mark.parametrize(("gain", "is_model"), [(0.5, True), (1.0, True), (6.0, False), (-6.0, False)])
def test_a_hypothesis_reads_no_more_than_the_record_under_mirrored_commands(
    search: SearchResult, gain: float, is_model: bool
) -> None:
    best = search.best
    other = replace(best, calibration=replace(best.calibration, gain=gain * best.calibration.gain))
    assert RULES.is_in_range(search.archive, other) is is_model


CYLINDER = model_from_table(
    {
        "format": 1,
        "name": "cylinder",
        "block": [
            {"id": "linear_transduction", "sensitivity_um_per_V": 3000.0},
            {"id": "plant_lag", "time_constant_s": 300.0},
        ],
    }
)


def test_an_integrator_that_leans_to_one_side_is_a_model() -> None:
    """A loop that holds a cylinder commands its weak side for longer: mirrored, it leaves the range of the record."""
    cycle_V = np.repeat([1.0, -1.0], [30, round(30 / 0.6)])
    record = record_of(CYLINDER, {"asymmetric_gain": {"difference": -0.4}}, np.tile(cycle_V, 4))
    problem = problem_of(CYLINDER, (observe(record),))
    archive = Archive(problem, NOISE_um)
    right = fit(problem, hypothesis(CYLINDER, [record], ("asymmetric_gain", (-0.4,))))
    bare = judge(problem, Hypothesis())
    assert bare is not None
    assert right is not None
    archive.add([bare, right])
    assert right.hypothesis.parts[0].values == pytest.approx((-0.4,), abs=0.05)
    assert archive.mirrored_span_um(right) > 2.0 * np.ptp(record.displacement_um)
    assert RULES.is_in_range(archive, right)


def test_what_follows_its_command_adds_nothing_up(search: SearchResult) -> None:
    assert search.archive.adds_up_um(search.best) == pytest.approx(0.0, abs=0.1)


def test_mirrored_twice_is_the_record_after_a_stand(search: SearchResult) -> None:
    (seen,) = search.problem.observations
    stood = replace(seen.mirrored(), start="from_voltage")
    np.testing.assert_allclose(stood.mirrored().mirrored().drive.voltage_V, stood.drive.voltage_V, atol=1e-12)
    np.testing.assert_allclose(stood.command_V, np.ptp(seen.command_V) + 2 * seen.command_V.min() - seen.command_V)
    assert stood.drive.command_time_s[0] < seen.drive.row_time_s[0]


def stepped(levels_V: Sequence[float]) -> Record:
    time_s = np.arange(0.0, 8.0, 0.02)
    voltage_V = np.array(levels_V)[np.minimum((time_s * len(levels_V) / 8.0).astype(int), len(levels_V) - 1)]
    return Record(time_s, voltage_V, 0.3 * voltage_V)


@pytest.mark.parametrize(
    ("levels_V", "few"),
    [((0.0, 20.0), True), ((20.0,), True), ((0.0, 20.0, 40.0), True), ((0.0, -5.0, -9.0), True),
     ((0.0, 20.0, 0.0), False), ((0.0, 10.0, 20.0, 40.0), False), ((20.0, 10.0), False)],
)  # fmt: skip
def test_a_step_or_two_one_way_do_not_show_whether_responses_add_up(levels_V: Sequence[float], few: bool) -> None:
    assert hardly_steps([observe(stepped(levels_V))]) is few
    assert hardly_steps([observe(stepped(levels_V)), observe(stepped((0.0, 20.0, 0.0)))]) is False


@pytest.mark.parametrize(
    ("form", "value", "word"), [("slew_limit", 30.0, "likely"), ("source_resistance", 0.4, "certain")]
)
def test_what_does_not_superpose_is_not_certain_from_one_step(form: str, value: float, word: str) -> None:
    parameter = {"slew_limit": "slew_rate_V_per_s", "source_resistance": "time_constant_s"}[form]
    record = record_of(effects={form: {parameter: value}}, voltage_V=np.repeat([0.0, 30.0], [40, 200]))
    (graded,) = told([record], hypothesis(PAPER, [record], (form, (value,)))).grades.effects
    assert graded.grade == word
    assert (graded.probability > RULES.likely) is (word == "certain")


def test_an_effect_that_ended_where_it_is_no_answer_is_not_certain(search: SearchResult) -> None:
    (graded,) = search.grades.effects
    assert graded.grade == "certain"
    best = search.best
    (part,) = best.hypothesis.parts
    ended = replace(part.form.free[0], high=part.values[0], no_answer_at="high")
    other = replace(best, hypothesis=Hypothesis((replace(part, form=replace(part.form, free=(ended,))),)))
    archive = Archive(search.problem, search.archive.noise_um)
    archive.add([search.found.base, other])
    (again,) = grade(Searched(archive, search.found.base, other), RULES).effects
    assert again.grade == "likely"


DELAY = {"transport_delay": {"delay_s": 0.05}}
DAMPED = {"structural_damping": {"damping_ratio": 0.006}}
ELSEWHERE = {"tip_mass": {"frequency_ratio": 1.03}}


def free_beside_the_delay(effects: dict[str, dict[str, Any]], *, given: bool = True) -> tuple[Archive, Fitted, Fitted]:
    """The archive of a record, the delay with all numbers of the model free, and that with names."""
    record = record_of(effects=effects)
    problem = problem_of(PAPER, (observe(record),))
    archive = Archive(problem, NOISE_um)
    bare = archive.fit(Hypothesis())
    own = own_form(PAPER)
    assert bare is not None
    assert own is not None
    delay = hypothesis(PAPER, [record], ("transport_delay", (0.05,)))
    free = archive.fit(delay.freeing(own, tuple(x.starts[0] for x in own.free)))
    assert free is not None
    kit = Kit(None, tuple(candidate_forms(PAPER, problem.observations)), own)
    kit = kit if given else kit.without_changes_of_numbers()
    return archive, free, with_named_numbers(archive, Catalogue((kit,)), Rules(), free)


@pytest.mark.parametrize("hidden", [DAMPED, ELSEWHERE], ids=["damping", "frequency"])
def test_a_number_that_the_readings_show_is_an_effect(hidden: dict[str, dict[str, Any]]) -> None:
    archive, free, named = free_beside_the_delay({**DELAY, **hidden})
    (effect,) = hidden
    assert free.hypothesis.effects == ("transport_delay",)
    assert set(named.hypothesis.effects) == {"transport_delay", effect}
    assert archive.square(named) <= 1.01 * archive.square(free)


def test_a_number_that_is_as_the_model_has_it_stays_a_recalibration() -> None:
    _, free, named = free_beside_the_delay(DELAY)
    assert named is free


def test_numbers_of_structures_that_no_model_gave_have_no_names() -> None:
    _, free, named = free_beside_the_delay({**DELAY, **DAMPED}, given=False)
    assert named is free


def test_a_fit_with_the_number_free_does_not_lack_the_effect() -> None:
    archive, free, named = free_beside_the_delay({**DELAY, **DAMPED})
    lacking = list(archive.lacking("structural_damping"))
    assert free not in lacking
    assert named not in lacking
    assert any(not x.hypothesis.parts for x in lacking)


def test_numbers_without_a_name_stay_free() -> None:
    _, free, _ = free_beside_the_delay(DELAY)
    assert free.hypothesis.own is not None
    rest = part_without_named(free.hypothesis.own, {"tip_mass"})
    assert rest is not None
    assert [x.name for x in rest.form.free] == ["bending_modes.damping_ratio"]
    assert part_without_named(free.hypothesis.own, {"tip_mass", "structural_damping"}) is None


@pytest.mark.slow
def test_what_a_simple_form_leaves_is_a_richer_form_and_no_further_effect(tmp_path: Path) -> None:
    """Stops in a row behind two misreadings: a loop of few numbers left what a curve of the reading took up."""
    strange = draw(430012)
    strange.write(tmp_path / "first.csv", 0)
    first = Structure().model((), 17.183)
    found = search_records(first, [read_record(tmp_path / "first.csv")], Settings())
    certain = [x.id for x in found.grades.effects if x.grade == "certain"]
    assert certain
    assert set(certain) <= strange.device.right_names


@pytest.mark.parametrize(("left", "first"), [(0.2, "flexible"), (0.5, "plain")])
def test_many_numbers_lead_where_they_leave_far_less_than_few(search: SearchResult, left: float, first: str) -> None:
    """Else a step is made on a plain form first, and one on the flexible form alone might never be."""
    plain = replace(search.found.base, training_square=1.0)
    (lag,) = hypothesis(PAPER, [record_of(effects=LAGGING)], LAG).parts
    form = replace(lag.form, name="flexible", free=lag.form.free * 9)
    flexible = replace(plain, hypothesis=Hypothesis((Part(form, lag.values * 9),)), training_square=left)
    leaders = leading_fits([plain, flexible])
    assert (leaders[0] is flexible) == (first == "flexible")
    assert len(leaders) == 2


STAIRS_V = np.concatenate([np.arange(0.0, 51.0), np.arange(49.0, -1.0, -1.0)]).repeat(6)
"""Six rows a level: what follows every step fills most of the record."""
HIDING_EACH_OTHER = {
    "transport_delay": {"delay_s": 0.06},
    "rate_independent_hysteresis": {
        "thresholds_V": (1.5, 4.0, 8.0, 14.0),
        "weights_um_per_V": (0.04, 0.03, 0.03, 0.02),
    },
}
PLAIN = model_from_table(
    {
        "format": 1,
        "name": "plain",
        "block": [
            {"id": "linear_transduction", "sensitivity_um_per_V": 0.46},
            {"id": "bending_modes", "first_frequency_Hz": 118.0, "damping_ratio": 0.03},
            {"id": "calibration"},
        ],
    }
)


def test_two_effects_that_hide_each_other_are_sought_as_a_pair() -> None:
    record = record_of(PLAIN, HIDING_EACH_OTHER, STAIRS_V)
    loop = ("Bouc-Wen", (-0.075, 0.08, -0.06))
    found = told([record], hypothesis(PLAIN, [record], loop), base=PLAIN).found
    catalogue = Catalogue((Kit(None, tuple(candidate_forms(PLAIN, found.archive.problem.observations))),))
    best = explore_beside_each(found.archive, catalogue, [found.best], found.best.training_square)
    leader = min(best, key=lambda x: x.training_square)
    assert set(leader.hypothesis.effects) == set(HIDING_EACH_OTHER)
    assert leader.hypothesis.parts[-1].values[0] == pytest.approx(0.06, abs=0.004)
    assert explore_beside_each(found.archive, catalogue, [found.best], 0.0) == []


@pytest.mark.slow
def test_a_staircase_of_quick_levels_shows_a_loop_and_a_delay() -> None:
    record = record_of(PLAIN, HIDING_EACH_OTHER, STAIRS_V)
    found = search_records(PLAIN, [record], Settings())
    assert set(found.best.hypothesis.effects) == set(HIDING_EACH_OTHER)


@pytest.mark.parametrize(
    ("threshold_V", "names"), [(0.2, {"source_resistance"}), (0.4, {"source_resistance", "dead_zone"})]
)
def test_what_one_number_more_removes_to_the_noise_is_an_effect(threshold_V: float, names: set[str]) -> None:
    """Both are small beside the noise; only the larger one shows over all rows."""
    record = record_of(effects={**LAGGING, "dead_zone": {"threshold_V": threshold_V}})
    both, alone = (hypothesis(PAPER, [record], *x) for x in ((LAG, ("dead_zone", (threshold_V,))), (LAG,)))
    found = told([record], both, [alone]).found
    lag = found.archive.fits[-1]
    assert lag.hypothesis.effects == ("source_resistance",)
    assert RULES.is_small(found.archive, found.base, lag)
    assert RULES.leaves_noise(found.archive, lag)
    assert set(parsimonious(found.archive, RULES).hypothesis.effects) == names


def test_the_first_step_says_for_how_long_steps_are_begun(search: SearchResult) -> None:
    said: list[str] = []
    search_module.search(search.archive.problem, Catalogue((Kit(None, ()),)), RULES, said.append)
    for_long = "steps are begun for some 13 s of an idle core, and as long again for each effect found"
    assert said == [f"step 1: trying 0 forms on model 1 of 1; {for_long}"]
