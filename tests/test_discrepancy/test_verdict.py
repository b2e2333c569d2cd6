"""What may be said, on fits put together by hand: every border of every word."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bender_discrepancy.fitting.criterion import VERY_STRONG, Yardstick, cost
from bender_discrepancy.records.outliers import FAR
from bender_discrepancy.search import verdict
from bender_discrepancy.search.evidence import EVIDENCE, closed_share, floor_limit, floor_square_um2
from bender_discrepancy.search.state import Found, Ranked
from bender_discrepancy.search.verdict import (
    as_given_square,
    decide,
    is_complete,
    one_loop,
    rivals_of,
    unstretched,
    would_stand,
)
from bender_plant.model import load_model

ROWS, NOISE_um = 100, 0.1
SQUARE = ROWS * NOISE_um**2
BY = Yardstick(3 * ROWS, 3.0 * ROWS, 1)


def seen(half_step_um: float = 0.0) -> Any:
    judging = np.arange(3 * ROWS) < ROWS
    return SimpleNamespace(
        judging=judging, training=~judging, usable=np.ones(3 * ROWS, dtype=bool), half_step_um=half_step_um,
        searched=np.ones(3 * ROWS, dtype=bool), measured_um=np.zeros(3 * ROWS),
    )  # fmt: skip


def problem(*observations: Any, given_um: float | None = 0.0) -> Any:
    records = observations or (seen(),)
    readings = None if given_um is None else [np.full(3 * ROWS, given_um) for _ in records]
    return SimpleNamespace(observations=records, readings=lambda _: readings, all_rows=3 * ROWS * len(records))


def fitted(over_noise: float, *effects: str, free: int | None = None, memory: bool = False, shown: bool = False) -> Any:
    """A fit that leaves so many times the noise."""
    square = SQUARE * over_noise**2
    parts = tuple(
        SimpleNamespace(form=SimpleNamespace(memory=memory, shown=shown, effect=x, beside="")) for x in effects
    )
    count = len(effects) if free is None else free
    hypothesis = SimpleNamespace(parts=parts, own=None, effects=effects, free_count=count)
    scale = over_noise * NOISE_um
    wave = np.resize([1.0, -1.0], 3 * ROWS)
    return SimpleNamespace(
        hypothesis=hypothesis, held_square=square, training_square=2.0 * square, residuals=(scale * wave,)
    )


def found(base: Any, best: Any, ranking: tuple[Any, ...] = ()) -> Found:
    ranked = tuple(Ranked(x, 0.0) for x in ranking)
    return Found(problem(), base, best, NOISE_um, BY, ranked, ranked, (base, best))


@pytest.fixture(autouse=True)
def many_frequencies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verdict, "only_one_sine", lambda _: False)


def test_the_floor_is_noise_and_the_steps_of_the_readings() -> None:
    assert floor_square_um2(problem(), NOISE_um) == pytest.approx(0.01)
    # a step of 0.6 has the variance of a uniform number, 0.6^2 / 12; of two records the mean counts
    assert floor_square_um2(problem(seen(0.3)), NOISE_um) == pytest.approx(0.01 + 0.36 / 12.0)
    assert floor_square_um2(problem(seen(0.3), seen(0.0)), NOISE_um) == pytest.approx(0.01 + 0.5 * 0.36 / 12.0)


@pytest.mark.parametrize(("over_noise", "complete"), [(1.0, True), (1.41, True), (1.42, False), (5.0, False)])
def test_beside_an_effect_structure_below_the_noise_is_no_gap(over_noise: float, complete: bool) -> None:
    state = found(fitted(40.0), fitted(over_noise, "creep"))
    assert is_complete(state.problem, state) is complete


@pytest.mark.parametrize("again", [True, False])
@pytest.mark.parametrize(("part", "most"), [(0.99, True), (1.01, False)])
def test_effects_stand_if_they_close_most_and_would_be_named_again(
    part: float, most: bool, again: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verdict, "again_on_other_blocks", lambda *_: again)
    left = math.sqrt(part * (1.0 - EVIDENCE.closes) * 400.0 + 1.0)
    state = found(fitted(math.sqrt(401.0)), fitted(left, "creep"))
    assert (closed_share(state, state.best) >= EVIDENCE.closes) is most
    kept = unstretched(state)
    assert kept.best is (state.best if most and again else state.base)
    assert kept.steps == ((state.base, state.best) if most and again else (state.base,))


def test_the_part_that_is_closed_is_of_all_rows_that_choices_see(monkeypatch: pytest.MonkeyPatch) -> None:
    """Here the rows of choices hold a third of the rows, and nearly all that is left."""
    state = found(fitted(30.0), fitted(1.0, "creep"))
    left = np.where(seen().judging, 10.0 * NOISE_um, NOISE_um) * np.resize([1.0, -1.0], 3 * ROWS)
    monkeypatch.setattr(state.best, "residuals", (left,))
    assert closed_share(state, state.best) == pytest.approx(1.0 - (100.0 - 1.0) / 3.0 / (900.0 - 1.0))


def test_what_stands_is_not_taken_back() -> None:
    good = found(fitted(1.5), fitted(1.1, "creep"))
    assert unstretched(good) is good
    nothing = found(fitted(5.0), fitted(5.0))
    assert unstretched(nothing) is nothing


def test_named_at_the_noise_floor_is_complete_and_above_it_is_not() -> None:
    near = decide(problem(), found(fitted(30.0), fitted(1.1, "creep")))
    assert (near.word, near.complete) == ("named", True)
    assert "at the noise floor" in near.reason
    within = decide(problem(), found(fitted(60.0), fitted(2.0, "creep")))
    assert (within.word, within.complete) == ("named", False)
    assert "structure above the noise stays unexplained" in within.reason


def test_unexplained_leaves_the_size_of_the_residual_to_the_rows_that_are_reported() -> None:
    said = decide(problem(), found(fitted(8.0), fitted(3.0, "creep"), (fitted(3.5, "ageing"),)))
    assert (said.word, said.complete) == ("unexplained", False)
    assert "structure above the noise" in said.reason
    assert not any(x.isdigit() for x in said.reason)
    assert [x.id for x in said.rivals] == ["ageing"]


def rival_at(distance: float, best: Any, name: str = "ageing") -> Any:
    """A fit whose criterion is so much above that of the best."""
    start = cost(best, BY)
    square = (best.held_square + best.training_square) * math.exp(distance / BY.effective_rows)
    rival = fitted(math.sqrt(square / (3.0 * SQUARE)), name)
    assert cost(rival, BY) - start == pytest.approx(distance)
    return rival


@pytest.mark.parametrize(("distance", "word"), [(VERY_STRONG - 0.1, "ambiguous"), (VERY_STRONG + 0.1, "named")])
def test_a_rival_within_very_strong_evidence_makes_it_ambiguous(distance: float, word: str) -> None:
    best = fitted(1.05, "creep")
    said = decide(problem(), found(fitted(30.0), best, (best, rival_at(distance, best))))
    assert said.word == word
    assert [x.id for x in said.rivals] == ["ageing"]
    assert said.rivals[0].difference == pytest.approx(distance)
    if word == "ambiguous":
        assert "fit ageing as well" in said.reason


def test_rivals_are_others_and_stand_in_their_order() -> None:
    best = fitted(1.05, "creep")
    with_more = fitted(1.04, "creep", "ageing")
    first, second = rival_at(20.0, best), rival_at(40.0, best, "thermal_drift")
    state = found(fitted(30.0), best, (best, with_more, first, second))
    assert [x.id for x in rivals_of(state, state.last_ranking)] == ["ageing", "thermal_drift"]
    assert rivals_of(state, []) == ()


def test_a_flexible_rival_that_the_best_overtakes_is_none() -> None:
    best = fitted(1.05, "creep", free=1)
    flexible = fitted(0.98, "rate_independent_hysteresis", free=6)
    assert cost(flexible, BY) < cost(best, BY)
    state = found(fitted(30.0), best, (flexible,))
    assert rivals_of(state, state.last_ranking) == ()
    worse = fitted(1.3, "rate_independent_hysteresis", free=6)
    state = found(fitted(30.0), best, (worse,))
    assert [x.id for x in rivals_of(state, state.last_ranking)] == ["rate_independent_hysteresis"]


def test_a_memory_under_one_sine_is_ambiguous_whatever_the_rivals(monkeypatch: pytest.MonkeyPatch) -> None:
    best = fitted(1.05, "creep", memory=True)
    state = found(fitted(30.0), best, (best, rival_at(500.0, best)))
    assert decide(problem(), state).word == "named"
    assert not one_loop(problem(), state)
    monkeypatch.setattr(verdict, "only_one_sine", lambda _: True)
    assert one_loop(problem(), state)
    assert not one_loop(problem(), found(fitted(30.0), fitted(1.05, "saturation")))
    assert not one_loop(problem(), found(fitted(30.0), fitted(1.05, "source_resistance", memory=True, shown=True)))
    said = decide(problem(), state)
    assert said.word == "ambiguous"
    assert "one frequency at one amplitude" in said.reason
    assert [x.id for x in said.rivals] == ["ageing"]
    most = found(fitted(40.0), fitted(5.0, "creep", memory=True))
    assert decide(problem(), most).word == "ambiguous"
    little = found(fitted(5.0), fitted(4.0, "creep", memory=True))
    assert decide(problem(), little).word == "unexplained"


@pytest.mark.parametrize(("of_limit", "word"), [(0.5, "no_gap"), (0.99, "no_gap"), (1.01, "unexplained")])
def test_nothing_is_missing_only_where_the_energy_is_that_of_noise(of_limit: float, word: str) -> None:
    over_noise = math.sqrt(of_limit * floor_limit(problem(), EVIDENCE.confidence))
    base = fitted(over_noise)
    said = decide(problem(given_um=over_noise * NOISE_um), found(base, base))
    assert said.word == word
    assert said.complete is (word == "no_gap")
    assert said.rivals == ()


@pytest.mark.parametrize(("over_noise", "word"), [(0.99 * FAR, "no_gap"), (1.01 * FAR, "unexplained")])
def test_nothing_is_missing_only_where_no_reading_is_far_off(over_noise: float, word: str) -> None:
    base = fitted(1.0)
    base.residuals[0][[50, 51]] = over_noise * NOISE_um
    said = decide(problem(given_um=NOISE_um), found(base, base))
    assert said.word == word
    assert ("further from the simulation than noise" in said.reason) is (word == "unexplained")


@pytest.mark.parametrize(("beyond", "word"), [(0.98, "no_gap"), (1.02, "recalibrated")])
def test_a_calibration_matters_from_half_the_noise_on(beyond: float, word: str) -> None:
    base = fitted(1.0)
    off_um = NOISE_um * math.sqrt(1.0 + (beyond * EVIDENCE.matters) ** 2)
    assert decide(problem(given_um=off_um), found(base, base)).word == word


def test_steps_of_coarse_readings_are_no_gain_of_a_calibration() -> None:
    """A fit counts what lies beyond the steps; what lies within them is the same with the calibration and without."""
    base = fitted(1.0)
    base.calibration = SimpleNamespace(gain=1.0, offsets_um=(0.0,))
    assert decide(problem(seen(0.3), given_um=0.3), found(base, base)).word == "no_gap"


def test_the_model_as_given_is_judged_on_held_out_rows() -> None:
    base = fitted(1.0)
    state = found(base, base)
    assert as_given_square(problem(given_um=0.3), state) == pytest.approx(0.09)
    assert as_given_square(problem(given_um=None), state) == math.inf
    other = seen()
    other.measured_um = np.where(other.judging, 0.5, 99.0)
    assert as_given_square(problem(seen(), other, given_um=0.3), state) == pytest.approx(0.5 * (0.09 + 0.04))


@pytest.mark.parametrize(("free", "leaves", "word"), [(1, 0.9, "ambiguous"), (1, 1.1, "named"), (2, 0.9, "named")])
def test_a_rival_of_fewer_numbers_within_the_last_percent_of_the_gap_is_not_excluded(
    free: int, leaves: float, word: str
) -> None:
    base, best = fitted(300.0), fitted(1.0, "saturation", free=2)
    # in parts of a hundredth of the gap's size, beside the noise
    more = math.sqrt(1.0 + (leaves * EVIDENCE.form_within * 300.0) ** 2)
    rival = fitted(more, "electrostriction", free=free)
    assert cost(rival, BY) - cost(best, BY) > VERY_STRONG
    state = found(base, best, (best, rival))
    assert decide(state.problem, state).word == word
    coarse = fitted(1.8, "saturation", free=2)
    further = fitted(1.8 * 1.4, "electrostriction", free=free)
    incomplete = found(fitted(30.0), coarse, (coarse, further))
    assert decide(incomplete.problem, incomplete).word == "named"
    assert not any(x.plainer for x in decide(incomplete.problem, incomplete).rivals)


@pytest.mark.parametrize(("plain", "word"), [(1.02, "named"), (1.05, "ambiguous"), (None, "ambiguous")])
def test_a_plainer_rival_is_excluded_where_the_same_effects_in_as_plain_a_form_beat_it(
    plain: float | None, word: str
) -> None:
    """Then the further numbers of the best do not decide."""
    best, rival = fitted(1.0, "source_resistance", free=2), fitted(1.05, "sensor_lag", free=1)
    as_plain = () if plain is None else (fitted(plain, "source_resistance", free=1),)
    state = found(fitted(300.0), best, (best, rival, *as_plain))
    assert decide(state.problem, state).word == word


@pytest.mark.parametrize(
    ("other", "gap", "leaves", "own", "word"),
    [
        (("slew_limit", "sensor_lag"), 300.0, 0.95, 0.55, "ambiguous"),
        (("slew_limit", "sensor_lag"), 300.0, 0.95, 0.45, "named"),
        (("slew_limit", "sensor_lag"), 300.0, 1.05, 0.55, "named"),
        (("slew_limit", "sensor_lag"), 30.0, 0.95, 0.55, "named"),
        (("slew_limit", "electrostriction"), 300.0, 0.95, 0.55, "named"),
        (("saturation", "sensor_lag"), 300.0, 0.95, 0.55, "named"),
    ],
)
def test_a_lag_on_the_other_side_is_not_excluded_where_noise_alone_is_left_with_it(
    other: tuple[str, ...], gap: float, leaves: float, own: float, word: str
) -> None:
    """What a slew limit's form leaves decides no side; a hundredth of a gap of thirty times the noise is less.

    It is open only where the best leaves more than half the size of what that one leaves above the noise.
    """
    more = leaves * floor_limit(problem(), EVIDENCE.confidence)
    base, best = fitted(gap), fitted(math.sqrt(1.0 + own**2 * (more - 1.0)), "slew_limit", "source_resistance")
    rival = fitted(math.sqrt(more), *other)
    assert cost(rival, BY) - cost(best, BY) > VERY_STRONG
    state = found(base, best, (best, rival))
    assert decide(state.problem, state).word == word
    coarse, further = fitted(1.8, "slew_limit", "source_resistance"), fitted(1.8 * 1.4, *other)
    incomplete = found(fitted(30.0), coarse, (coarse, further))
    assert not any(x.other_side for x in decide(incomplete.problem, incomplete).rivals)


@pytest.mark.parametrize("beside", [(), ("ageing", "structural_damping"), ("supply_quantisation",)])
def test_beside_effects_that_superpose_no_form_leaves_what_has_a_side(beside: tuple[str, ...]) -> None:
    more = math.sqrt(0.95 * floor_limit(problem(), EVIDENCE.confidence))
    best, rival = fitted(1.0, *beside, "source_resistance"), fitted(more, *beside, "sensor_lag")
    state = found(fitted(300.0), best, (best, rival))
    assert cost(rival, BY) - cost(best, BY) > VERY_STRONG
    assert decide(state.problem, state).word == "named"


@pytest.mark.parametrize("order", [("slew_limit", "sensor_lag", "ageing"), ("sensor_lag", "ageing", "slew_limit")])
def test_a_rival_is_called_by_the_effect_that_the_best_lacks(order: tuple[str, ...]) -> None:
    """Effects stand in the order in which they were found; the last one may be in both."""
    best, rival = fitted(1.0, "slew_limit", "ageing", "source_resistance"), fitted(1.001, *order)
    state = found(fitted(300.0), best, (best, rival))
    assert [x.id for x in decide(state.problem, state).rivals] == ["sensor_lag"]


@pytest.mark.parametrize(("times", "word"), [(1.95, "ambiguous"), (2.05, "named")])
def test_where_structure_is_left_a_rival_that_leaves_less_than_twice_as_much_is_not_excluded(
    times: float, word: str
) -> None:
    best = fitted(2.0, "saturation")
    rival = fitted(math.sqrt(1.0 + times * 3.0), "electrostriction")
    assert cost(rival, BY) - cost(best, BY) > VERY_STRONG
    state = found(fitted(60.0), best, (best, rival))
    said = decide(state.problem, state)
    assert (said.word, said.complete) == (word, False)
    assert ("with electrostriction in its place" in said.reason) is (word == "ambiguous")
    assert would_stand(state) is (word == "named")


def test_a_rival_in_several_hypotheses_is_told_once() -> None:
    best, rivals = fitted(2.0, "saturation"), [fitted(2.1, *x, "creep") for x in ((), ("ageing",))]
    state = found(fitted(60.0), best, (best, *rivals))
    assert decide(state.problem, state).reason.count("creep") == 1


@pytest.mark.parametrize(("beside", "word"), [("electrostriction", "named"), ("ageing", "ambiguous")])
def test_a_rival_of_more_effects_is_held_to_the_best_beside_the_same_ones(beside: str, word: str) -> None:
    """An effect that was taken out again does not help a rival that has kept it."""
    best, rival = fitted(5.0, "structural_damping"), fitted(6.0, "electrostriction", "sensor_lag")
    longer = fitted(3.0, "structural_damping", beside)
    state = found(fitted(60.0), best, (best, longer, rival))
    assert cost(rival, BY) - cost(best, BY) > VERY_STRONG
    assert decide(state.problem, state).word == word


@pytest.mark.parametrize(("beside", "word"), [("charge_leakage", "named"), ("ageing", "ambiguous")])
def test_a_rival_of_more_effects_that_fits_better_has_to_beat_the_best_beside_the_same_ones(
    beside: str, word: str
) -> None:
    """One effect more fits better beside either: that tells nothing of the other one."""
    best, rival = fitted(5.0, "thermal_drift"), fitted(4.5, "charge_leakage", "creep", free=3)
    longer = fitted(2.9, "thermal_drift", beside, free=3)
    state = found(fitted(60.0), best, (longer, rival, best))
    assert cost(rival, BY) < cost(best, BY)
    said = decide(state.problem, state)
    assert said.word == word
    assert (said.rivals[0].difference > VERY_STRONG) is (word == "named")


@pytest.mark.parametrize(("theirs", "word"), [(0.94, "named"), (0.99, "ambiguous"), (1.05, "ambiguous")])
def test_the_same_change_among_the_models_own_numbers_is_no_rival(theirs: float, word: str) -> None:
    """Another damping beside the frequency that was named is no other explanation, beside a slight change it is."""
    base = load_model("paper")

    def at(fit: Any, ratio: float, own: object) -> Any:
        changed = base.with_values({"bending_modes.frequency_factor": ratio})
        vars(fit.hypothesis).update(own=own, model=lambda _: changed)
        return fit

    best = at(fitted(2.0, "tip_mass"), 0.95, None)
    rival = at(fitted(2.1, "structural_damping"), theirs, object())
    state = found(fitted(60.0), best, (best, rival))
    state = replace(state, problem=SimpleNamespace(**vars(state.problem), base=base))
    assert decide(state.problem, state).word == word


def test_a_curve_of_the_output_may_be_a_dead_zone_of_it_and_the_other_way_round_it_is_not_known() -> None:
    curve, gap = fitted(2.0, "output_curve"), fitted(2.1, "output_dead_zone")
    assert decide(problem(), found(fitted(60.0), curve, (curve, gap))).word == "named"
    curve, gap = fitted(2.1, "output_curve"), fitted(2.0, "output_dead_zone")
    assert decide(problem(), found(fitted(60.0), gap, (gap, curve))).word == "ambiguous"


def test_where_nothing_is_left_the_evidence_alone_decides() -> None:
    best, rival = fitted(1.1, "saturation"), fitted(1.15, "electrostriction")
    state = found(fitted(60.0), best, (best, rival))
    assert cost(rival, BY) - cost(best, BY) > VERY_STRONG
    assert decide(state.problem, state).word == "named"
    assert not any(x.as_large for x in decide(state.problem, state).rivals)
    assert would_stand(state)
