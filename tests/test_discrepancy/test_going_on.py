"""Where a search goes on: from effects none of which is certain before the last of them is there."""

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest
from told_diagnosis import record_of, told

from bender_discrepancy.effects.form import Free, simple
from bender_discrepancy.fitting.fit_problem import Calibration
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.search import beam
from bender_discrepancy.search.budget import BUDGET
from bender_discrepancy.search.evidence import EVIDENCE, simplest_as_good
from bender_discrepancy.search.state import Found, Ranked, leaders_of, set_out_from

GAP_um2 = 30.0


def model(effects: Sequence[str], mean_square: float, rows: int, numbers: int = 1) -> Fitted:
    """A hypothesis of effects, the last of so many numbers, which leaves so much in every row."""
    hypothesis = Hypothesis()
    for name in effects:
        count = numbers if name == effects[-1] else 1
        free = tuple(Free(f"{name}_{k}", 0.0, 2.0, False, (1.0,)) for k in range(count))
        hypothesis = hypothesis.plus(simple(name, *free), (1.0,) * count)
    half = 0.5 * mean_square * rows
    return Fitted(hypothesis, Calibration(1.0, (0.0,)), (), half, half)


@pytest.fixture(scope="module")
def known() -> Found:
    found = told([record_of()]).found
    rows = found.problem.all_rows
    base = replace(found.base, training_square=0.5 * GAP_um2 * rows, held_square=0.5 * GAP_um2 * rows)
    return replace(found, base=base, noise_um=0.06)


@pytest.fixture
def whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hypotheses without residuals leave something in which another effect may be sought, and white residuals."""
    monkeypatch.setattr(beam, "cost", lambda x, by: by.effective_rows * math.log(x.training_square))
    monkeypatch.setattr(beam, "_is_finished", lambda *_: False)
    monkeypatch.setattr(beam, "_says_no_more", lambda *_: False)


@pytest.mark.usefixtures("whole")
@pytest.mark.parametrize(("left_um2", "goes_on"), [(0.095, True), (0.1699, False)])
def test_a_search_goes_on_from_what_is_not_certain_while_the_evidence_grows(
    known: Found, left_um2: float, goes_on: bool
) -> None:
    """A lag closes nearly all of the gap; a backlash and a hum beside it leave too much for either to be certain."""
    rows = known.problem.all_rows
    lag = model(("lag",), 0.46, rows)
    play = model(("lag", "backlash"), 0.17, rows)
    hum = model(("lag", "backlash", "hum"), left_um2, rows)
    before = replace(known, best=lag)
    found = replace(before, last_ranking=(Ranked(hum, -9000.0),))
    ahead = beam._following(found, before, EVIDENCE, beam._Ahead([play], looked=True))
    assert (ahead is not None and list(ahead.beam) == [hum]) is goes_on
    # what is certain is gone on from in any case
    assert beam._following(replace(found, best=hum), before, EVIDENCE, beam._Ahead([play], looked=True)) is not None


def test_some_of_the_effects_alone_are_no_simpler_hypothesis() -> None:
    rows = 1000
    base, best = model((), GAP_um2, rows), model(("lag", "backlash", "creep"), 0.01, rows, 4)
    fewer, other = model(("lag", "backlash"), 0.1, rows), model(("lag", "backlash", "drift"), 0.1, rows)
    assert simplest_as_good([best, fewer], base, nothing_left=False) is best
    assert simplest_as_good([best, fewer, other], base, nothing_left=False) is other


def test_a_step_is_held_to_the_model_that_it_set_out_from() -> None:
    lag, play, hum = (model(("lag", "backlash", "hum")[: k + 1], 1.0, 10) for k in range(3))
    other = model(("lag", "drift"), 0.5, 10)
    assert list(set_out_from([other, play, lag], hum, lag)) == [play]
    assert list(set_out_from([lag], play, lag)) == []


def test_of_every_set_of_effects_the_best_leads() -> None:
    lag, play = model(("lag",), 1.0, 10), model(("lag", "backlash"), 0.5, 10)
    same = model(("backlash", "lag"), 0.6, 10)
    assert leaders_of([Ranked(play, -3.0), Ranked(same, -2.0), Ranked(lag, 0.0)], lag) == [lag, play]


@pytest.mark.parametrize(
    ("certain_um2", "leads_um2", "times"),
    [(GAP_um2, 0.1, 1.0 + 3 * BUDGET.per_effect), (10.0, 5.0, 1.0 + BUDGET.per_effect), (20.0, 5.0, 1.0)],
)
def test_effects_that_close_most_of_the_gap_may_be_searched_longer(
    known: Found, monkeypatch: pytest.MonkeyPatch, certain_um2: float, leads_um2: float, times: float
) -> None:
    rows = known.problem.all_rows
    squares = {1: certain_um2, 3: leads_um2}
    monkeypatch.setattr(beam, "closed_share", lambda _found, x: 1.0 - squares[len(x.hypothesis.parts)] / GAP_um2)
    found = replace(known, best=model(("lag",), certain_um2, rows))
    leader = model(("lag", "backlash", "hum"), leads_um2, rows)
    allowed = times * BUDGET.work_for(rows)
    for share, affordable in ((0.999, True), (1.001, False)):
        spent = round(share * allowed / (1.0 + BUDGET.work_growth))
        assert beam._is_affordable(found, leader, [0, spent], EVIDENCE) is affordable
