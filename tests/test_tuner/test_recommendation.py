"""Whether a model is followed: decided on what its diagnosis leaves open, said with what decided it."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from bender_loop.control.metrics import SETTLING_BAND
from bender_loop.control.pid import Gains
from bender_loop.fmu.diagnosed import LEAST_GAIN_ERROR_PERCENT, Diagnosed, Known
from bender_native.ready import ready_plant_fmu
from bender_plant.model import load_model
from bender_tuner.results.summary import recommendation_rows
from bender_tuner.results.tuning_file import tuning_document
from bender_tuner.task.following import Following
from bender_tuner.task.practitioner import PractitionerObjective, PractitionerReport
from bender_tuner.task.problem import silent
from bender_tuner.task.recommendation import METHOD, RUNS_AWAY, device_of, recommend
from bender_tuner.task.session import Session, how_to_follow, open_guarded, pose_problem_in_units, run_session
from bender_tuner.task.settings import GAIN_ERROR_PERCENT, LATE_FRAMES, make_settings

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"
SCHEMA = json.loads((REFERENCE / "tuning.schema.json").read_text(encoding="utf-8"))
ONE_CLOCK = {"rate_Hz": 50.0, "latency_frames": 0, "exposure_s": 0.0, "evaluations": 61}
NEAR = Known(LEAST_GAIN_ERROR_PERCENT, 1e-3)
percents = st.floats(0.0, 90.0)


def tuned(known: Known | None) -> tuple[Session, dict[str, object]]:
    """A dead time of three samples, tuned, and what its `tuning.json` says of following."""
    fmu = ready_plant_fmu(load_model("beam").with_block("transport_delay", delay_s=0.06))
    with open_guarded(fmu, found=Diagnosed(known=known)) as (plant, facts):
        problem = pose_problem_in_units(plant, make_settings(**ONE_CLOCK), facts)
        found = run_session(plant, facts, problem, follow_model=True)
    text = tuning_document(
        problem, facts, found.searches, found.contenders, found.rule, status=found.ended.value, reason=found.reason,
        model_following=found.recommendation,
    )  # fmt: skip
    told = json.loads(text)
    assert [x.message for x in Draft202012Validator(SCHEMA).iter_errors(told)] == []
    return found, told["model_following"]


@pytest.fixture(scope="module")
def unknown() -> tuple[Session, dict[str, object]]:
    return tuned(None)


@pytest.fixture(scope="module")
def known() -> tuple[Session, dict[str, object]]:
    return tuned(NEAR)


def test_behind_a_dead_time_the_diagnosis_decides(unknown: tuple[Session, dict], known: tuple[Session, dict]):
    """With a gain that is 30 % off the block alone is better there, and with what the records leave open it is not."""
    assert unknown[0].following is None
    assert known[0].following is not None
    assert [x.method for x in known[0].contenders][1] == METHOD
    alone, followed = known[0].recommendation.scores[:2]  # pyright: ignore[reportOptionalMemberAccess]
    assert followed.report.settling_time_s < 0.5 * alone.report.settling_time_s


def test_of_a_device_that_may_answer_more_as_much_is_held_back_as_leaves_it_arrived(
    known: tuple[Session, dict], unknown: tuple[Session, dict]
):
    """Of a device of which nothing is known nothing is held back."""
    session = known[0]
    assert session.following is not None
    assert 0.0 < session.following.model.held_back < SETTLING_BAND
    followed = session.recommendation.scores[1].report  # pyright: ignore[reportOptionalMemberAccess]
    assert max(x.metrics.overshoot_percent for x in followed.cases) < 5.0 - 100.0 * session.following.model.held_back
    tried = unknown[0].recommendation.tried  # pyright: ignore[reportOptionalMemberAccess]
    assert {x.following.model.held_back for x in tried} == {0.0}


def test_what_is_known_leaves_the_gains_as_robust_as_they_were(
    unknown: tuple[Session, dict], known: tuple[Session, dict]
):
    assert known[0].contenders[0].gains == unknown[0].contenders[0].gains
    judgement = known[0].contenders[0].judgement
    assert judgement is not None
    assert {x.gain_factor for x in judgement.practitioner.cases} == {0.7, 1.0, 1.3}
    assert judgement.practitioner.bounds_kept


@pytest.mark.parametrize("which", ["unknown", "known"])
def test_the_file_has_what_decided_side_by_side(which: str, request: pytest.FixtureRequest):
    session, told = request.getfixturevalue(which)
    scores = {x["method"]: x for x in told["scores"]}
    assert {"reliable_bas", METHOD, "simc"} <= set(scores)
    better = scores[METHOD]["value"] < scores["reliable_bas"]["value"]
    assert told["recommended"] == better == (which == "known")
    assert told["sentence"] == session.following_note
    assert told["judged_with"]["by"] == ("diagnosis" if which == "known" else "settings")
    factors = {x["gain_factor"] for x in scores[METHOD]["cases"]}
    percent = told["judged_with"]["gain_error_percent"]
    assert factors == {1.0 - percent / 100.0, 1.0, 1.0 + percent / 100.0}
    assert len(told["tried"]["value"]) == len(told["tried"]["horizon_ticks"]) > 2
    columns, rows = recommendation_rows(session.recommendation)
    assert [row[0] for row in rows] == [x["label"] for x in told["scores"]]
    assert all(len(row) == len(columns) for row in rows)


def test_a_refusal_begins_with_the_options_that_may_turn_it_round_and_says_by_what_it_was_judged(
    unknown: tuple[Session, dict],
):
    options = r"model following is not recommended: try --gain-error .* 30 % .* --late-frames 0 .*; "
    assert re.match(
        options + r".*nearer to the set-point.*30 % \(--gain-error\).*--late-frames", unknown[1]["sentence"]
    )


def test_what_runs_away_where_the_gains_hold_is_refused_whatever_a_diagnosis_says(known: tuple[Session, dict]):
    chosen = known[0].following
    assert chosen is not None
    fmu = chosen.fmu
    with open_guarded(fmu) as (plant, facts):
        problem = pose_problem_in_units(plant, make_settings(**ONE_CLOCK), facts)
        wild = replace(problem, practitioner=_RunsAway(problem.practitioner))  # pyright: ignore[reportArgumentType]
        found = recommend(wild, known[0].contenders[:1], chosen.model, fmu, NEAR, silent)
    assert found is not None
    assert (found.following, found.sentence) == (None, RUNS_AWAY)


class _RunsAway:
    """An objective on devices on which everything that follows a model runs away."""

    def __init__(self, judge: PractitionerObjective) -> None:
        self.judge, self.priorities = judge, judge.priorities

    def evaluate(self, gains: Gains, following: Following | None = None) -> PractitionerReport:
        return replace(self.judge.evaluate(gains), value=math.inf if following else 1.0)


def test_what_is_not_asked_for_is_null(unknown: tuple[Session, dict]):
    x = unknown[0]
    with open_guarded(ready_plant_fmu("beam")) as (_, facts):
        text = tuning_document(x.problem, facts, x.searches, x.contenders, x.rule, status="complete", reason="")
    assert json.loads(text)["model_following"] is None


def test_every_key_of_the_file_is_described():
    page = (REFERENCE / "tuning.md").read_text(encoding="utf-8")
    described = set(re.findall(r"`(\w+)`", page))
    assert set(SCHEMA["properties"]) <= described
    assert set(SCHEMA["$defs"]["model_following"]["properties"]) <= described


@settings(max_examples=200, deadline=None)
@given(
    asked=st.none() | percents,
    late=st.none() | st.integers(0, 3),
    known=st.none() | st.builds(Known, percents, st.floats(0.0, 1.0)),
    rate_Hz=st.floats(1.0, 1000.0),
)
def test_a_word_of_the_user_stands_and_a_diagnosis_never_widens(
    asked: float | None, late: int | None, known: Known | None, rate_Hz: float
):
    found = device_of(make_settings(gain_error_percent=asked, late_frames=late, rate_Hz=rate_Hz), known)
    if asked is not None:
        assert found.gain_error_percent == asked
    if late is not None:
        assert found.late_frames == late
    assert asked is not None or found.gain_error_percent <= GAIN_ERROR_PERCENT
    assert late is not None or found.late_frames <= LATE_FRAMES
    if known is None:
        assert not found.by_diagnosis
    elif found.by_diagnosis and late is None and found.late_frames == 0:
        assert known.delay_error_s * rate_Hz < 0.5
    assert math.isfinite(found.gain_error_percent)


@pytest.mark.parametrize("known", [None, Known(60.0, 1e-3), Known(8.0, 1e-3)])
def test_by_what_a_device_is_known_is_said_unless_the_user_says_all(known: Known | None):
    found = device_of(make_settings(), known, "d/diagnosis.json: so well")
    assert found.source.startswith("d/diagnosis.json: so well")
    assert ("60 %" in found.source) == (known is not None and known.gain_error_percent == 60.0)
    assert device_of(make_settings(gain_error_percent=5.0, late_frames=0), known, "d/diagnosis.json").source == ""


def test_how_gains_that_follow_a_model_are_run_is_said():
    gains = Path("results/tune/gains.toml")
    said = how_to_follow(gains, foreign=False)
    assert "`bender hil --gains results/tune/gains.toml`" in said
    assert "`bender fmu controller results/tune/gains.toml`" in said
    assert "fmu controller" not in how_to_follow(gains, foreign=True)
