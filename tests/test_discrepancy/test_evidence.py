"""What keeps a diagnosis from saying too much: other blocks, the floor, never worse, the start, the voltages seen."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reported_diagnosis import FRAME_S, NOISE_um, hypothesis, levels, record_of, told
from scipy.signal import lfilter

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.contenders import contenders
from bender_discrepancy.conclusion.measurement.corrected_model import Gap
from bender_discrepancy.conclusion.measurement.gap import Measured, after_calibration, recalibrated_readings
from bender_discrepancy.conclusion.shares import held_square_um2, shares_of_gap
from bender_discrepancy.workflow import conclude, diagnose
from bender_inference.experiment.profiles import seen_limits
from bender_inference.fitting.blocked import predicted_errors
from bender_inference.fitting.fit_problem import problem_of
from bender_inference.fitting.hypothesis import Hypothesis, Part
from bender_inference.fitting.output_error import fit
from bender_inference.fitting.own_numbers import own_form
from bender_inference.records.initial_motion import beginnings
from bender_inference.records.noise import by_chance_um2, floor_ratio_limit, noise_floor_um
from bender_inference.records.observations import observe, turns_plays
from bender_inference.search.archive import Archive
from bender_inference.search.judgement.grades import contradicted, grade, relevant_part
from bender_inference.search.judgement.probability import Case, probability
from bender_inference.search.judgement.rules import Rules
from bender_inference.search.judgement.verdict import Verdict, calibration_matters, decide
from bender_inference.search.search import Searched
from bender_inference.settings import Settings
from bender_loop.errors import InputError
from bender_loop.records.record import Record
from bender_plant.model import load_model, model_from_table

PAPER = load_model("paper")


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_blocks_are_predicted_as_fits_to_all_others_predict_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    slopes, block = rng.normal(size=(240, 4)), np.arange(240) // 20
    left = slopes @ rng.normal(size=4) + rng.normal(size=240)
    found = predicted_errors(slopes, left, block, np.full(4, np.inf))
    for k in range(12):
        own = block == k
        numbers = np.linalg.lstsq(slopes[~own], left[~own], rcond=None)[0]
        assert found[own] == pytest.approx(left[own] - slopes[own] @ numbers, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("volts", "turned"),
    [
        (np.linspace(0.0, 50.0, 60), False),
        (np.linspace(50.0, 0.0, 60), False),
        (np.full(60, 20.0), False),
        (np.concatenate([np.linspace(0.0, 50.0, 40), np.linspace(50.0, 30.0, 20)]), False),
        (np.concatenate([np.linspace(0.0, 50.0, 40), np.linspace(50.0, 20.0, 20)]), True),
        (np.concatenate([np.linspace(50.0, 0.0, 40), np.linspace(0.0, 30.0, 20)]), True),
    ],
)
def test_plays_are_turned_by_a_rise_and_a_fall_of_half_of_what_is_spanned(volts: np.ndarray, turned: bool) -> None:
    assert turns_plays([observe(record_of(voltage_V=volts))]) is turned


@pytest.mark.parametrize("rows", [180, 2000])
def test_noise_exceeds_the_limit_of_its_own_floor_as_rarely_as_told(rows: int) -> None:
    rng, usable = np.random.default_rng(11), np.ones(rows, dtype=bool)
    judged = rows // 5
    limit, beyond = floor_ratio_limit(rows, judged, 0.05), 0
    for _ in range(200):
        noise = rng.standard_normal(rows)
        beyond += float(np.mean(noise[:judged] ** 2)) > limit * noise_floor_um(noise, usable) ** 2
    # of 200 draws at 5 %, 24 and more come once in a thousand times
    assert 0 < beyond < 24


@pytest.mark.slow
def test_effects_that_leave_more_than_calibration_alone_are_taken_out_again() -> None:
    record = record_of(gain=1.1)
    absurd = told([record], hypothesis(PAPER, [record], ("source_resistance", (2.0,))), refit=False)
    assert absurd.best.hypothesis.parts
    found = conclude(absurd, ["record"], lambda _: None)
    assert (found.verdict, found.added, found.is_complete) == ("unexplained", (), False)
    assert "calibration alone" in found.reason
    assert found.gap.after.rms_um == pytest.approx(found.gap.recalibrated.rms_um, rel=0.01)
    assert found.gap.after.all_rms_um == pytest.approx(NOISE_um, rel=0.1)


def test_a_good_model_is_kept_and_a_worse_one_is_not_written(tmp_path: Path) -> None:
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.06}})
    found = conclude(
        told([record], hypothesis(PAPER, [record], ("source_resistance", (0.05,)))), ["record"], lambda _: None
    )
    assert [x.id for x in found.added] == ["source_resistance"]
    assert not found.gap.is_worse
    found.write(tmp_path, report=False)
    assert (tmp_path / "model.fmu").exists()
    worse = replace(found, gap=replace(found.gap, after=found.gap.before, recalibrated=found.gap.after))
    assert worse.gap.is_worse
    (tmp_path / "worse").mkdir()
    worse.write(tmp_path / "worse", report=False)
    assert sorted(x.name for x in (tmp_path / "worse").iterdir()) == ["diagnosis.json"]
    assert worse.to_dict()["model"] is None
    assert any("no model was written" in x for x in worse.to_dict()["warnings"])


def test_what_held_out_readings_do_not_show_to_close_any_of_the_gap_is_not_written(tmp_path: Path) -> None:
    record = record_of(effects=LAGGING, voltage_V=levels(4.0))
    own = own_form(PAPER)
    assert own is not None
    freed = Hypothesis(own=Part(own, tuple(x.starts[0] for x in own.free)))
    diagnoses = [
        conclude(told([record], best), ["record"], lambda _: None)
        for best in (hypothesis(PAPER, [record], LAG), freed, None)
    ]
    written, said = [], []
    for k, closed in enumerate([(0.4, 0.25), (-0.1, 0.0), (0.4, 0.15)]):
        for found in diagnoses:
            out = tmp_path / f"{k}-{len(found.added)}-{found.findings.is_corrected}"
            out.mkdir()
            found = replace(found, gap=replace(found.gap, closed=closed))
            found.write(out, report=False)
            written.append((out / "model.toml").exists())
            said.append(any("do not show that it would be better" in x for x in found.to_dict()["warnings"]))
    # calibration alone is no effect of which held-out readings would have to show anything
    assert written == [False, False, True, False, False, True, True, True, True]
    assert said == [not x for x in written]


def test_what_the_noise_of_few_quiet_readings_does_is_no_reason_to_take_an_effect_out() -> None:
    rng = np.random.default_rng(5)
    apart = rng.standard_normal(15) * 0.03
    noise = 0.05 * rng.standard_normal((4000, 15))
    # two models that are as good as each other: one as far above the truth as the other is below it
    differences = np.mean((noise + 0.5 * apart) ** 2 - (noise - 0.5 * apart) ** 2, axis=1)
    beyond = np.sum(differences > by_chance_um2(0.05, apart, 0.99))
    # of 4000 draws at 1 %, fewer than 21 and 60 and more come once in a thousand times each
    assert 20 < beyond < 60

    left, alone = Gap(0.055, 1.0), Gap(0.050, 1.0)
    chance = by_chance_um2(0.05, apart, 0.99)
    quiet = Measured(alone, alone, left, 0.05, [], [], [], 15, chance, chance)
    assert not quiet.is_worse
    assert replace(quiet, after=Gap(0.09, 1.0)).is_worse
    # calibration on rows that show something else may have made the model worse than it was given
    assert replace(quiet, recalibrated=Gap(0.12, 1.0), after=Gap(0.09, 1.0)).is_worse
    assert by_chance_um2(0.05, apart[:0], 0.99) == 0.0


@pytest.mark.slow
def test_effects_that_unseen_readings_contradict_are_taken_out_again() -> None:
    """Something that no effect has is small where fits and choices look, and large in the blocks that are reported."""
    record = record_of("paper", {"source_resistance": {"time_constant_s": 0.2}})
    rng, rows = np.random.default_rng(8), observe(record).reported
    smooth = np.convolve(rng.standard_normal(len(record) + 14), np.hanning(15), "valid")
    smooth /= np.std(smooth)
    given = Simulator(observe(record).drive).run(PAPER).reading_um
    size_um = float(np.std(record.displacement_um - given))
    clear, torn = (
        diagnose(PAPER, [replace(record, displacement_um=record.displacement_um + size_um * part * smooth)])
        for part in (0.15, np.where(rows, 0.6, 0.15))
    )
    assert ([x.id for x in clear.added], clear.is_complete) == (["source_resistance"], False)
    assert torn.verdict != "named"
    assert not torn.findings.certain


LAG_S = 0.4


@given(st.lists(st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=5), min_size=1, max_size=3))
def test_the_next_experiment_stays_within_the_voltages_of_the_records(volts: list[list[float]]) -> None:
    found = seen_limits([np.array(x) for x in volts])
    every = [0.0, *(v for x in volts for v in x)]
    assert (found.low_V, found.high_V) == (min(every), max(every))
    assert seen_limits([np.array(x) for x in volts], 7.0).high_V == 7.0


@pytest.mark.parametrize("wrong", [{"confidence": 1.0}, {"confidence": 0.2}, {"start": "still"}])
def test_settings_say_what_is_wrong(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        Settings(**wrong)  # pyright: ignore[reportArgumentType]


def test_the_clock_of_a_placed_beginning_is_the_records() -> None:
    record = record_of(voltage_V=np.concatenate([[40.0] * 12, levels(10.0, 3)]))
    for x in beginnings(observe(record), PAPER):
        assert np.array_equal(x.time_s, FRAME_S * np.arange(record.time_s.size))
        assert np.array_equal(x.command_V, record.voltage_V)


LAG, HUM = ("source_resistance", (0.06,)), ("periodic_disturbance", (0.5, 0.0, 1.3))
LAGGING = {"source_resistance": {"time_constant_s": 0.06}}


@pytest.fixture(scope="module")
def lagging():
    """A lag, found with a hum that is not there."""
    record = record_of(effects=LAGGING)
    both = hypothesis(PAPER, [record], LAG, HUM)
    return told([record], both, [hypothesis(PAPER, [record], x) for x in (LAG, HUM)])


@given(st.floats(0.0, 20.0), st.floats(1.0, 1e6), st.floats(0.0, 1.0), st.floats(-0.5, 1.0))
def test_rows_that_no_choice_saw_only_take_from_a_probability(
    deviations: float, ratio: float, closed: float, unseen: float
):
    case = Case.of(deviations, 1.0, 1.0 / ratio, closed)
    after = case.seen_by_none(unseen)
    assert probability(after) <= probability(case)
    assert after.closed <= case.closed
    assert case.seen_by_none(1.0).deviations == case.deviations


def test_nothing_is_certain_that_unseen_rows_contradict(lagging) -> None:
    effect = lagging.grades.effects[0]
    assert effect.probability > 0.9
    doubted = [contradicted(replace(effect, grade="certain"), x) for x in (0.8, 0.4, 0.0)]
    assert all(x.grade != "certain" for x in doubted)
    assert sorted((x.probability for x in doubted), reverse=True) == [x.probability for x in doubted]
    assert doubted[-1].probability < effect.probability - 0.1


def test_a_named_effect_that_unseen_rows_contradict_becomes_likely(lagging, monkeypatch: pytest.MonkeyPatch) -> None:
    sure = tuple(replace(x, grade="certain") for x in lagging.grades.effects)
    found = replace(
        lagging, grades=replace(lagging.grades, effects=sure), verdict=Verdict("named", "by hand", complete=False)
    )
    monkeypatch.setattr(Measured, "falls_short", lambda _self, _closes: True)
    diagnosis = conclude(found, ["record.csv"], lambda _: None)
    said = diagnosis.to_dict()
    assert said["verdict"] == "likely"
    assert all(x["grade"] != "certain" for x in said["effects"])
    assert "held-out readings" in diagnosis.findings.reason


def test_an_effect_that_nobody_would_miss_is_left_out(lagging) -> None:
    searched = lagging.found
    assert [x.grade == "certain" for x in grade(searched, Rules()).effects] == [True, False]
    assert relevant_part(searched, Rules()).best.hypothesis.effects == ("source_resistance",)


def test_a_certain_effect_that_nobody_would_miss_stays_only_where_it_explains_the_rest() -> None:
    small = ("periodic_disturbance", (0.2, 0.0, 1.3))
    hum = {"periodic_disturbance": {"sine_um": 0.2, "cosine_um": 0.0, "frequency_Hz": 1.3}}
    record = record_of(effects={**LAGGING, **hum})
    clicks = replace(record, displacement_um=record.displacement_um + 0.12 * np.sign(np.sin(9.0 * record.time_s)))
    kept = []
    for readings in (record, clicks):
        both = hypothesis(PAPER, [readings], LAG, small)
        found = told([readings], both, [hypothesis(PAPER, [readings], x) for x in (LAG, small)]).found
        told_grades = {x.id: x.grade for x in grade(found, Rules()).effects}
        # beside clicks that nothing explains, what knows the time alone is not certain
        assert told_grades == {
            "source_resistance": "certain",
            "periodic_disturbance": "certain" if readings is record else "likely",
        }
        kept.append(relevant_part(found, Rules(relevant=0.02)).best.hypothesis.effects)
    assert kept == [("source_resistance", "periodic_disturbance"), ("source_resistance",)]


@pytest.mark.slow
def test_what_one_block_alone_shows_of_a_part_that_nobody_would_miss_is_left_out() -> None:
    """The device is a broken line, of which the record leaves the lowest piece after three rows."""
    k = np.arange(297.0)
    volts = np.concatenate([[0.24, 0.37, 0.72], 1.5 + 0.4 * np.sin(0.3 * k) + 0.3 * np.sin(0.117 * k)])
    readings_um = np.concatenate([[0.0], 0.0869 * volts[:-1] - np.where(volts[:-1] > 0.75, 0.002, 0.0029 * volts[:-1])])
    blocks = [
        {"id": "linear_transduction", "sensitivity_um_per_V": 0.0869},
        {"id": "calibration", "gain": 1.0, "offset_um": -0.002},
    ]
    model = model_from_table({"format": 1, "name": "gain", "block": blocks})
    found = diagnose(model, [Record(0.19 * np.arange(300.0), volts, readings_um)])
    assert (found.verdict, found.effects) == ("no_gap", ())
    assert found.sentence.endswith("the residual is below 0.5 % of the stroke (--relevant).")


def test_a_disturbance_is_found_beside_a_command_of_slow_sines() -> None:
    """So slow that there is an overtone of them within the resolution of the record at every frequency."""
    time_s, rng = 0.07 * np.arange(320.0), np.random.default_rng(3)
    sines = [a * np.sin(2.0 * np.pi * f * time_s) for a, f in ((9.0, 0.1), (6.0, 0.21), (4.0, 0.3))]
    volts = 20.0 + np.sum(sines, axis=0)
    readings_um = 0.5 * np.concatenate([volts[:1], volts[:-1]]) + 0.3 * np.sin(4.2 * time_s + 1.0)
    table = {"format": 1, "name": "gain", "block": [{"id": "linear_transduction", "sensitivity_um_per_V": 0.5}]}
    found = diagnose(model_from_table(table), [Record(time_s, volts, readings_um + 0.02 * rng.normal(size=320))])
    assert (found.verdict, [x.id for x in found.added]) == ("named", ["periodic_disturbance"])


def limited(*high_rows: int) -> Record:
    """A record of a gain of 1 µm/V with a limit at 30 µm, reached in 30 rows from each of some, beside a hum."""
    rng = np.random.default_rng(5)
    time_s, volts = FRAME_S * np.arange(600.0), rng.uniform(10.0, 20.0, 600)
    for k in high_rows:
        volts[k : k + 30] = rng.uniform(25.0, 50.0, 30)
    held = np.concatenate([[0.0], volts[:-1]])
    hum_um = 0.3 * np.sin(2.0 * np.pi * 1.3 * time_s)
    return Record(time_s, volts, np.minimum(held, 30.0) + hum_um + NOISE_um * rng.standard_normal(600))


@pytest.mark.parametrize(("high_rows", "word"), [((300,), "likely"), ((120, 300, 480), "certain")])
def test_what_one_block_alone_shows_is_not_certain_beside_structure(high_rows: tuple[int, ...], word: str) -> None:
    blocks = [
        {"id": "linear_transduction", "sensitivity_um_per_V": 1.0},
        {"id": "calibration", "gain": 1.0, "offset_um": 0.0},
    ]
    model, records = model_from_table({"format": 1, "name": "gain", "block": blocks}), [limited(*high_rows)]
    search = told(records, hypothesis(model, records, ("limit above", (30.0,))), base=model)
    (graded,) = search.grades.effects
    assert graded.grade == word
    # it closes the gap either way, but of what happens once nobody would miss the name
    relevant = relevant_part(search.found, Rules(relevant=0.9)).best.hypothesis.effects
    assert relevant == (("output_limit",) if word == "certain" else ())


def quiet(
    effects: dict[str, dict[str, Any]], noise_um: float, hum_um: float, *parts: tuple[str, tuple[float, ...]]
) -> Searched:
    """These forms, and without one of them each, fitted to a record with so much noise and a hum that none explains."""
    record = record_of(effects=effects)
    drive = Drive.of_rows(record.time_s, record.voltage_V)
    plant = PAPER
    for effect, parameters in effects.items():
        plant = plant.with_block(effect, **parameters)
    noise = noise_um * np.random.default_rng(3).standard_normal(len(record))
    noise += hum_um * np.sin(17.0 * record.time_s)
    record = replace(record, displacement_um=Simulator(drive).run(plant).reading_um + noise)
    bench = problem_of(PAPER, (observe(record),))
    kept = [[y for y in parts if y is not x] for x in parts]
    fits = [fit(bench, hypothesis(PAPER, [record], *x)) for x in ((), parts, *kept)]
    archive = Archive(bench, noise_um)
    archive.add([x for x in fits if x is not None])
    base, best = fits[:2]
    assert base is not None
    assert best is not None
    return Searched(archive, base, best)


def grades_of(effects: dict[str, dict[str, Any]], noise_um: float, *parts: tuple[str, tuple[float, ...]]) -> Any:
    """The grade of each of these forms, fitted to such a record without that hum."""
    return {x.id: x.grade for x in grade(quiet(effects, noise_um, 0.0, *parts), Rules()).effects}


@pytest.mark.parametrize(("sine_um", "word"), [(0.02, "likely"), (0.2, "certain")])
def test_what_adds_no_more_than_the_last_percent_of_the_gap_is_not_certain(sine_um: float, word: str) -> None:
    hum = {"sine_um": sine_um, "cosine_um": 0.0, "frequency_Hz": 1.3}
    parts = (("source_resistance", (0.06,)), ("periodic_disturbance", (sine_um, 0.0, 1.3)))
    found = grades_of({**LAGGING, "periodic_disturbance": hum}, 0.001, *parts)
    assert found == {"source_resistance": "certain", "periodic_disturbance": word}


@pytest.mark.parametrize("threshold_V", [1.0, 6.0])
def test_a_small_effect_that_takes_all_that_another_one_leaves_is_certain(threshold_V: float) -> None:
    zone = {"threshold_V": threshold_V}
    found = grades_of({**LAGGING, "dead_zone": zone}, 0.001, LAG, ("dead_zone", (threshold_V,)))
    assert found == {"source_resistance": "certain", "dead_zone": "certain"}


@pytest.mark.parametrize(("time_constant_s", "word"), [(2000.0, "likely"), (30.0, "certain")])
def test_an_effect_of_which_no_number_is_told_is_not_certain(time_constant_s: float, word: str) -> None:
    """A leak that hardly begins within the record is a slope: part and time constant make up for each other."""
    leak = {"fraction": 0.5, "time_constant_s": time_constant_s}
    found = grades_of({"charge_leakage": leak}, 0.01, ("charge_leakage", (0.5, time_constant_s)))
    assert found == {"charge_leakage": word}


@pytest.mark.parametrize(
    ("effects", "part", "least_um", "word"),
    [
        (LAGGING, LAG, 0.05, "certain"),
        (LAGGING, LAG, 4.0, "likely"),
        ({"periodic_disturbance": {"sine_um": 1.0, "cosine_um": 0.0, "frequency_Hz": 1.3}}, HUM, 0.05, "likely"),
    ],
)
def test_beside_structure_what_closes_most_and_knows_more_than_the_time_is_certain(
    effects: dict[str, dict[str, Any]], part: tuple[str, tuple[float, ...]], least_um: float, word: str
) -> None:
    (graded,) = grade(quiet(effects, 0.001, least_um, part), Rules()).effects
    assert graded.grade == word


@pytest.mark.parametrize(("least_um", "stays"), [(0.01, True), (0.04, False)])
def test_an_effect_that_nobody_would_miss_stays_beside_little_structure(least_um: float, stays: bool) -> None:
    """It closes nine tenths of what the others leave, or too little, and noise alone is left in neither case."""
    hum = {"periodic_disturbance": {"sine_um": 0.1, "cosine_um": 0.0, "frequency_Hz": 1.3}}
    parts = (LAG, ("periodic_disturbance", (0.1, 0.0, 1.3)))
    found = quiet({**LAGGING, **hum}, 0.001, least_um, *parts)
    assert relevant_part(found, Rules(relevant=0.01)).best.hypothesis.effects == tuple(x for x, _ in parts[: 1 + stays])


def test_two_effects_of_which_each_is_missed_both_stay() -> None:
    effects = {**LAGGING, "periodic_disturbance": {"sine_um": 2.0, "cosine_um": 0.0, "frequency_Hz": 1.3}}
    record = record_of(effects=effects)
    large = ("periodic_disturbance", (2.0, 0.0, 1.3))
    both = hypothesis(PAPER, [record], LAG, large)
    found = told([record], both, [hypothesis(PAPER, [record], x) for x in (LAG, large)]).found
    assert relevant_part(found, Rules(relevant=0.02)).best is found.best


def test_a_residual_that_nobody_would_miss_makes_no_verdict() -> None:
    searched = told(
        [record_of(effects={"periodic_disturbance": {"sine_um": 0.1, "cosine_um": 0.0, "frequency_Hz": 1.3}})]
    ).found
    words = [decide(searched, grade(searched, x), x).word for x in (Rules(relevant=0.0), Rules(relevant=0.02))]
    assert words == ["unexplained", "no_gap"]


@pytest.fixture(scope="module")
def both():
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.06}})
    best = hypothesis(PAPER, [record], LAG, HUM)
    return told([record], best, [hypothesis(PAPER, [record], x) for x in (LAG, HUM)])


def test_shares_add_up_to_what_the_hypothesis_closes(both) -> None:
    archive, base, best = both.archive, both.found.base, both.best
    shares = shares_of_gap(archive, base, best)
    gap, left = (held_square_um2(x, archive.problem) - archive.noise_um**2 for x in (base, best))
    assert set(shares) == set(best.hypothesis.effects)
    assert sum(shares.values()) == pytest.approx(1.0 - max(left, 0.0) / gap, abs=1e-6)
    assert shares["source_resistance"] > 0.9 > 0.1 > shares["periodic_disturbance"]


def test_an_effect_that_alone_predicts_worse_than_nothing_has_its_share_beside_others(both) -> None:
    archive, base, best = both.archive, both.found.base, both.best
    (lag,) = (x for x in archive.fits if x.hypothesis.effects == ("source_resistance",))
    worse = replace(lag, residuals=tuple(3.0 * x for x in base.residuals))
    archive = replace(archive, fits=[worse if x is lag else x for x in archive.fits])
    assert shares_of_gap(archive, base, best)["source_resistance"] == pytest.approx(0.5, abs=0.05)


def test_the_order_of_the_effects_does_not_matter(both) -> None:
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.06}})
    other = told([record], hypothesis(PAPER, [record], HUM, LAG), [hypothesis(PAPER, [record], x) for x in (LAG, HUM)])
    one = shares_of_gap(both.archive, both.found.base, both.best)
    assert shares_of_gap(other.archive, other.found.base, other.best) == pytest.approx(one, abs=1e-6)


def test_an_effect_alone_has_all_that_is_closed() -> None:
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.06}})
    alone = told([record], hypothesis(PAPER, [record], LAG), [])
    assert contenders(alone)[0].share_of_gap == pytest.approx(1.0, abs=0.01)


def test_calibration_stands_only_where_it_predicts_blocks_that_it_was_not_fitted_to() -> None:
    off = told([record_of(gain=0.9)], word="recalibrated")
    given, alone = recalibrated_readings(off)
    assert abs(alone[0] - given[0]).max() > 1.0
    true = told([record_of()], word="no_gap")
    given, _ = recalibrated_readings(true)
    measured = [x.measured_um for x in true.problem.observations]
    # the readings themselves: nothing can predict better
    assert after_calibration(true, measured, measured) is measured


@pytest.mark.parametrize(("offset_um", "matters"), [(0.02, False), (0.045, True)])
def test_a_calibration_of_half_the_noise_is_worth_a_word(offset_um: float, matters: bool) -> None:
    search = told([record_of(offset_um=offset_um)])
    assert calibration_matters(search.archive, search.found.base, Rules()) is matters


def test_calibration_that_gains_less_than_its_error_hardly_ever_stands(both) -> None:
    """Of readings that wander about the model as given, gain and offset follow the wandering."""
    measured, stood = both.problem.observations[0].measured_um, 0
    for seed in range(40):
        left = np.asarray(lfilter([1.0], [1.0, -0.98], np.random.default_rng(seed).normal(size=measured.size)))
        fitted = replace(both.found.base, residuals=(left - left.mean(),))
        simulated = [measured - left]
        wandering = replace(both, found=replace(both.found, base=fitted))
        stood += after_calibration(wandering, simulated, simulated) is not simulated
    assert stood <= 12


def test_what_keeps_a_leader_from_being_certain_is_its_reason() -> None:
    record = record_of(effects=LAGGING)
    rival = hypothesis(PAPER, [record], ("sensor_lag", (0.06,)))
    search = told([record], hypothesis(PAPER, [record], LAG), [rival])
    (model,) = search.grades.effects
    sine = decide(search.found, replace(search.grades, one_sine=True), Rules())
    assert (sine.word, sine.complete) == ("ambiguous", search.grades.complete)
    assert "one frequency at one amplitude" in sine.reason
    likely = replace(model, grade="likely", probability=0.7, rivals=(replace(model.rivals[0], reach="as large"),))
    verdict = decide(search.found, replace(search.grades, effects=(likely,), complete=False), Rules())
    assert verdict.word == "likely"
    assert verdict.reason.endswith(f"{model.rivals[0].id} is not excluded")
    alone = replace(search.grades, effects=(replace(likely, rivals=()),))
    reasons = [decide(search.found, replace(alone, complete=x), Rules()).reason for x in (False, True)]
    assert ["stays unexplained" in x for x in reasons] == [True, False]
