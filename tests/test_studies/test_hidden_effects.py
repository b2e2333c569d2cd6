"""The judge of hidden effects: what counts as right, what the figures are, and a small slice of the benchmark."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_cli.main import main
from bender_loop.records.record import write_record
from bender_proving import Bench, make_case
from bender_studies.hidden_effects.figures import candidates_of, confusion, false_names, figures, wilson
from bender_studies.hidden_effects.judging import MOST_CANDIDATES, Judged, central_share, numbers_right
from bender_studies.hidden_effects.outputs import to_json
from bender_studies.hidden_effects.trial import CENTRAL, Answer, Trial, answer

MANY = ("creep", "ageing", "thermal_drift", "charge_leakage", "sensor_lag", "source_resistance")
GAP = {"after": {"rms_um": 0.06}, "noise_floor_um": 0.06}


def judged(kind: str, truth: tuple[str, ...], verdict: str, named: tuple[str, ...] = (), **more: object) -> Judged:
    certain = named if verdict == "named" else ()
    second = {"before_um": 1.0, "after_um": 0.1}
    answer = Answer("case-0", verdict, named, certain=certain, gap=GAP, seconds=1.0, second=second)
    case = Judged(kind, truth, "camera", False, answer, None, 0.06, 0.06, None)
    return replace(case, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("case", "right"),
    [
        (judged("single", ("creep",), "named", ("creep",)), True),
        (judged("single", ("creep",), "named", ("creep", "ageing")), False),
        (judged("single", ("creep",), "ambiguous", ("creep",)), False),
        (judged("single", ("creep",), "unexplained", ("creep",)), False),
        (judged("pair", ("creep", "backlash"), "named", ("backlash", "creep")), True),
        (judged("pair", ("creep", "backlash"), "named", ("creep",)), False),
        (judged("single", ("creep",), "named", ("tip_mass", "creep"), way="approximate"), True),
        (judged("single", ("creep",), "named", ("tip_mass", "creep")), False),
        (judged("single", ("creep",), "named", ("tip_mass",), way="approximate"), False),
        (judged("single", ("creep",), "named", ("ageing", "creep"), way="approximate"), False),
        (judged("nothing", (), "no_gap"), True),
        (judged("nothing", (), "recalibrated"), True),
        (judged("nothing", (), "named", ("creep",)), False),
        (judged("nothing", (), "error"), False),
        (judged("nothing", (), "unexplained"), False),
        (judged("nothing", (), "ambiguous"), False),
        (judged("calibration", (), "recalibrated"), True),
        (judged("calibration", (), "no_gap"), False),
        (judged("outside", ("stick_slip",), "unexplained"), True),
        (judged("outside", ("stick_slip",), "unexplained", ("backlash",)), False),
        (judged("outside", ("stick_slip",), "named", ("backlash",)), False),
        (judged("weak", ("creep",), "ambiguous", ("creep",)), True),
        (judged("weak", ("creep",), "ambiguous", ("ageing",)), False),
        (judged("weak", ("creep",), "named", ("creep",)), False),
        (judged("weak", ("ageing",), "", answer=Answer("a", "ambiguous", ("creep",), ("ageing",))), True),
        (judged("weak", ("creep",), "", answer=Answer("a", "ambiguous", MANY[:1], MANY[1:MOST_CANDIDATES])), True),
        (judged("weak", ("creep",), "", answer=Answer("a", "ambiguous", MANY[:1], MANY[1:])), False),
    ],
)
def test_what_is_right(case: Judged, right: bool) -> None:
    assert case.is_right == right


def test_a_part_that_is_certain_beside_open_effects_counts_where_it_is_true() -> None:
    truth = ("creep", "sensor_lag")
    answers = [
        Answer("case-0", "ambiguous", named, rivals, certain)
        for named, rivals, certain in (
            (("creep", "source_resistance"), ("sensor_lag",), ("creep",)),
            (("ageing", "source_resistance"), ("sensor_lag",), ("ageing",)),
            (("creep", "source_resistance"), ("sensor_lag",), ()),
        )
    ]
    right, false, open_ = (judged("pair", truth, "", answer=x) for x in answers)
    assert [x.is_partly_right for x in (right, false, open_)] == [True, False, False]
    assert [x.false_names for x in (right, false, open_)] == [frozenset(), {"ageing"}, frozenset()]
    found = {x.words: x.value for x in figures([right, false, open_])}
    assert found["several effects, not all of them named: a part told as certain, nothing else"] == pytest.approx(1 / 3)


def test_moved_forms_that_another_effect_comes_within_may_stay_open_where_they_are_listed() -> None:
    moved = {"moved": 0.1, "lookalike": "source_resistance"}
    open_ = judged(
        "moved", ("sensor_lag",), "", answer=Answer("a", "ambiguous", ("sensor_lag",), ("slew_limit",)), **moved
    )
    false = judged("moved", ("sensor_lag",), "named", ("source_resistance",), **moved)
    told = judged("moved", ("dead_zone",), "named", ("dead_zone",), moved=0.1)
    found = {x.words: (x.value, x.count) for x in figures([open_, false, told])}
    assert found["form moved by 10 %: its name alone"] == (pytest.approx(1 / 3), 3)
    assert found["form moved by 10 %, no other effect within that: its name alone"] == (1.0, 1)
    assert found["form moved, another effect within that: its name, or open with the truth listed"] == (0.5, 2)
    assert json.loads(to_json({}, [open_]))["cases"][0]["lookalike"] == "source_resistance"


def test_the_record_that_an_open_answer_asks_for_is_judged_beside_the_first() -> None:
    moved = {"moved": 0.05, "lookalike": "source_resistance"}
    open_ = Answer("a", "ambiguous", ("source_resistance",), ("sensor_lag",), columns=("supply_voltage_V",))
    afters = [Answer("a", "named", (name,), certain=(name,)) for name in ("sensor_lag", "source_resistance")]
    right, false = (judged("moved", ("sensor_lag",), "", answer=open_, after=x, **moved) for x in afters)
    still = judged("moved", ("sensor_lag",), "", answer=open_, after=open_, **moved)
    told = judged("moved", ("creep",), "named", ("creep",), moved=0.05)
    found = {x.words: (x.value, x.count) for x in figures([right, false, still, told])}
    assert found["form moved by 5 %: its name alone"] == (0.25, 4)
    assert found["form moved by 5 %, after the record that an open answer asks for: its name alone"] == (0.5, 4)
    assert found["form moved, after that record: a false name"] == (0.25, 4)
    share = found["an open answer that asks for a further record: the right name after it"]
    assert share == (pytest.approx(1 / 3), 3)
    told_of = json.loads(to_json({}, [right]))["cases"][0]
    assert told_of["asked_for"] == ["supply_voltage_V"]
    assert told_of["right_after"] is True


def test_candidates_are_all_names_of_an_ambiguous_answer() -> None:
    answers = (Answer("case-0", "ambiguous", MANY[:1], MANY[1:count]) for count in (5, 6))
    assert candidates_of([judged("weak", ("creep",), "", answer=x) for x in answers]) == (5.5, 6)


def test_what_is_left_is_what_the_judge_measures() -> None:
    flattered = judged("single", ("creep",), "named", ("creep",), left_um=0.12)
    assert flattered.over_floor == pytest.approx(2.0)
    assert math.isnan(judged("single", ("creep",), "named", ("creep",)).over_floor)


def test_a_model_that_runs_away_on_a_second_record_counts_as_the_worst() -> None:
    fine = judged("single", ("creep",), "named", ("creep",))
    gone = replace(fine, answer=replace(fine.answer, second={"before_um": 1.0, "after_um": math.inf}))
    found = {x.words: x for x in figures([fine, gone, gone])}
    second = found["single effect: gap left on a second record, median"]
    assert (second.value, second.count, second.is_kept) == (math.inf, 3, False)
    assert found["single effect: its name alone"].value == 1.0
    assert json.loads(to_json({}, [fine, gone]))["cases"][1]["of_second_gap"] is None


def test_figures_count_what_was_judged() -> None:
    right = judged("single", ("creep",), "named", ("creep",))
    wrong = judged("single", ("creep",), "named", ("ageing",))
    found = {x.words: x for x in figures([right, right, right, wrong])}
    name = found["single effect: its name alone"]
    assert (name.value, name.count, name.is_kept) == (0.75, 4, False)
    second = found["single effect: gap left on a second record, median"]
    noise = 0.06**2 * central_share(CENTRAL)
    assert second.value == pytest.approx(math.sqrt((0.1**2 - noise) / (1.0 - noise)))
    assert second.is_kept
    assert not any("two effects" in words for words in found)
    assert false_names([right, wrong]) == {"ageing": 1}
    assert confusion([right, right, wrong]) == [("creep", "creep", 2), ("creep", "ageing", 1)]


@given(st.integers(1, 500), st.data())
def test_the_interval_holds_the_share(count: int, data: st.DataObject) -> None:
    part = data.draw(st.integers(0, count)) / count
    low, high = wilson(part, count)
    assert 0.0 <= low <= part + 1e-12
    assert part - 1e-12 <= high <= 1.0


@given(st.integers(0, 1000))
def test_the_central_share_is_that_of_drawn_noise(seed: int) -> None:
    drawn = np.sort(np.abs(np.random.default_rng(seed).normal(size=20_000)))
    assert np.mean(drawn[: int(CENTRAL * drawn.size)] ** 2) == pytest.approx(central_share(CENTRAL), rel=0.05)


@pytest.mark.slow
def test_a_slice_of_the_benchmark(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--kinds", "singles", "--effects", "charge_leakage", "--seeds", "1", "--first-seed", "7", "--jobs", "1"]
    assert (
        main(["benchmark", "discrepancy", *words, "--nothing-seeds", "1", "--jobs", "1", "--out", str(tmp_path)]) == 0
    )
    table = json.loads((tmp_path / "discrepancy.json").read_text(encoding="utf-8"))
    assert [x["hidden"] for x in table["cases"]] == [["charge_leakage"]]
    assert all(x["right"] and x["over_floor"] < 1.2 and x["of_second_gap"] < 0.1 for x in table["cases"])
    assert "its name alone" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(("effect", "seed"), [("thermal_drift", 36201), ("sensor_quantisation", 36201)])
def test_a_size_behind_another_gain_is_judged_where_it_acts(effect: str, seed: int, tmp_path: Path) -> None:
    """What the surroundings add passes the gain of the bench, a step of the readings does not."""
    case = replace(make_case("single", (effect,), seed, "camera"), gain=0.8)
    bench = Bench(case)
    path, out = tmp_path / "record.csv", tmp_path / "answer"
    record = bench.record(bench.excitation(), bench.noise())
    write_record(path, record)
    found = answer(Trial(case.id, (path,), None, out, None, None))
    assert found.named == (effect,)
    assert numbers_right(case, found, float(np.ptp(record.time_s)))
    (hidden,) = case.effects
    half = replace(case, effects=(replace(hidden, magnitude=0.5 * hidden.magnitude),))
    assert not numbers_right(half, found, float(np.ptp(record.time_s)))
