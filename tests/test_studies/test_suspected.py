"""Parameter against effect: what counts as right, and what as a false name."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from bender_discrepancy.foreign.competition import Account
from bender_proving.systems.suspected import suspected_case
from bender_studies.hidden_effects.suspected import SuspectedAnswer, judge, judged_suspects, totals

LAG = "plant_lag.time_constant"


@pytest.fixture(scope="module")
def lag_off() -> tuple[object, float]:
    case = suspected_case(0, 1)
    return case, case.off["time_constant_s"]


def test_a_parameter_is_right_within_three_per_cent_and_alone(lag_off: tuple[object, float]) -> None:
    case, value = cast("tuple", lag_off)
    for answer, right, false in (
        (SuspectedAnswer(0, "recalibrated", (), {LAG: 1.02 * value}), True, ()),
        (SuspectedAnswer(0, "recalibrated", (), {LAG: 1.05 * value}), False, ()),
        (SuspectedAnswer(0, "ambiguous", (), {LAG: value}), False, ()),
        (SuspectedAnswer(0, "ambiguous", ("creep",), {}), False, ()),
        (SuspectedAnswer(0, "named", ("creep",), {LAG: value}), False, ("creep",)),
        (SuspectedAnswer(0, "named", ("creep",), {}), False, ("creep",)),
        (SuspectedAnswer(0, "no_gap"), False, ()),
    ):
        found = judge(case, answer)
        assert (found.is_right, found.false) == (right, false), answer


def test_an_effect_is_right_without_a_parameter_and_under_both_of_its_names() -> None:
    case = suspected_case(1, 1)
    assert case.effect == "lens_distortion"
    assert judge(case, SuspectedAnswer(1, "named", ("output_curve",))).is_right
    wrong = judge(case, SuspectedAnswer(1, "named", ("lens_distortion",), {LAG: 0.21}))
    assert (wrong.is_right, wrong.false) == (False, (LAG,))
    rows = totals([wrong, judge(case, SuspectedAnswer(1, "named", ("lens_distortion",)))])
    assert rows[1] == ["effect", "2", "1", "0", "1"]
    assert rows[-1] == ["all", "2", "1", "0", "1"]


def test_an_effect_was_picked_among_all_starts_and_a_parameter_among_those_named() -> None:
    effects = cast(Any, SimpleNamespace(added=[SimpleNamespace(id="creep"), SimpleNamespace(id="dead_zone")]))
    nothing = cast(Any, SimpleNamespace(added=[]))
    moved = cast(Any, SimpleNamespace(parameters=("a",), unseen={"b": "why", "c": "why"}))
    assert Account(effects, None).selection_cost(300) == pytest.approx(4.0 * math.log(300))
    assert Account(nothing, moved).selection_cost(300) == pytest.approx(2.0 * math.log(3))
    assert Account(nothing, None).selection_cost(300) == 0.0


@pytest.mark.slow
def test_a_damping_that_is_off_beside_an_effect_is_a_number_of_the_fmu(tmp_path: Path) -> None:
    (answer,) = judged_suspects([31], 71, tmp_path, 1)
    assert answer.is_right, answer.said


@pytest.mark.slow
def test_a_lag_that_is_off_is_not_taken_for_a_creep_that_cancels_it(tmp_path: Path) -> None:
    # a relaxation whose zero falls on the pole as given turns it into the true one, with one number more
    (found,) = judged_suspects([2], 1, tmp_path, 1)
    assert (found.kind, found.is_right) == ("parameter", True), found.said


@pytest.mark.slow
def test_a_lag_that_is_off_is_found_where_an_effect_had_hidden_it_and_another_one_made_up_for_it(
    tmp_path: Path,
) -> None:
    (found,) = judged_suspects([23], 81, tmp_path, 1)
    assert (found.kind, found.is_right) == ("both", True), found.said
