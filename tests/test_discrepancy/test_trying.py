"""One step of the search: which starts are fitted."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from bender_discrepancy.effects.form import Form, Values, amplitude, scale
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.starts import Start
from bender_discrepancy.search import revise, step
from bender_discrepancy.search.budget import BUDGET
from bender_discrepancy.search.revise import looked_back
from bender_discrepancy.search.step import ELSEWHERE, _Fits, _in_other_valleys, _is_elsewhere, _leading, _Rough, _starts
from bender_plant.model import Model


def form(effect: str, name: str, solved: bool) -> Form:
    def unchanged(model: Model, values: Values) -> Model:
        del values
        return model

    free = amplitude("size", 1.0, 10.0) if solved else scale("width", 0.1, 10.0, 3)
    return Form(effect, name, (free,), unchanged)


@pytest.mark.parametrize("solved", [1, BUDGET.starts, 4 * BUDGET.starts])
def test_starts_that_a_fit_cannot_better_leave_room_for_those_that_it_can(solved: int) -> None:
    first = [(form("hysteresis", f"plays {k}", True), Start((1.0,), 1.0 + k)) for k in range(solved)]
    later = [(form("hysteresis", f"scale {k}", False), Start((1.0,), 100.0 + k)) for k in range(2 * BUDGET.starts)]
    names = [x.name for x, _ in _leading([*first, *later], 1)]
    assert names[: min(solved, BUDGET.starts)] == [f"plays {k}" for k in range(min(solved, BUDGET.starts))]
    assert names[min(solved, BUDGET.starts) :] == [f"scale {k}" for k in range(BUDGET.starts)]


def test_no_more_effects_are_fitted_than_asked_for() -> None:
    starts = [(form(f"effect {k % 4}", f"form {k}", k % 2 == 0), Start((1.0,), float(k))) for k in range(12)]
    assert [x.name for x, _ in _leading(starts, 2)] == ["form 0", "form 1", "form 4", "form 5", "form 8", "form 9"]


def test_a_form_that_refines_another_sets_out_from_every_valley_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The valley that promises more does not take all its starts, nor those of the plainer form."""
    plain = form("spring", "plain", False)
    bent = replace(plain, name="bent", free=(*plain.free, scale("bend", 1.0, 4.0, 2)), refines="plain")
    softer = replace(bent, name="softer", free=(*bent.free, scale("soft", 1.0, 4.0, 2)), refines="bent")
    promised = {"plain": [Start((0.1,), 10.0), Start((10.0,), 50.0)]}

    def scanned(problem: Any, base: Any, form: Form, noise_um: float, keep: int, beside: Any) -> list[Start]:
        del problem, base, noise_um, beside
        if form.name in promised:
            return promised[form.name][:keep]
        values = tuple(x.starts[0] for x in form.free)
        return [Start(values, values[0] - len(values))][:keep]

    monkeypatch.setattr(step, "scan_any", scanned)
    monkeypatch.setattr(step, "only_one_sine", lambda _: False)
    problem = cast("Any", SimpleNamespace(observations=[SimpleNamespace(training=np.ones(100, bool))]))
    parent = cast("Any", SimpleNamespace(hypothesis=Hypothesis()))
    found = _starts(problem, parent, [softer, plain, bent], 0.1, cast("Any", None))
    where = {(x.name, start.values[0]) for x, start in found}
    assert where == {(name, value) for name in ("plain", "bent", "softer") for value in (0.1, 10.0)}


def width_of(value: float) -> Hypothesis:
    return Hypothesis().plus(form("hysteresis", "loop", False), (value,))


@given(st.floats(0.2, 9.0), st.floats(0.5, 2.0))
def test_a_start_lies_elsewhere_where_a_number_differs_by_more_than_a_twentieth(value: float, ratio: float) -> None:
    apart = abs(1.0 - ratio) / max(1.0, ratio)
    assume(abs(apart - ELSEWHERE) > 1e-9)
    assert _is_elsewhere(width_of(value), width_of(value * ratio)) is (apart > ELSEWHERE)


@pytest.mark.parametrize(("left", "others"), [(8.0, [5.0]), (1.0, [])])
def test_other_valleys_are_looked_into_where_structure_is_left(
    left: float, others: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of starts that promise enough, and lie elsewhere: none where the best leaves noise alone."""
    fitted: list[float] = []

    def fit(problem: Any, hypothesis: Hypothesis) -> Any:
        del problem
        fitted.append(hypothesis.parts[-1].values[0])
        return SimpleNamespace(hypothesis=hypothesis, training_square=1.0)

    monkeypatch.setattr(step, "fit", fit)
    rows, noise_um = 100, 0.1
    square = rows * noise_um**2 * left
    best = cast("Any", SimpleNamespace(hypothesis=width_of(1.0), training_square=square))
    fits = _Fits(cast("Any", SimpleNamespace(noise_um=noise_um)), (), rows, 4, {"hysteresis": best})
    hopeless = 2.0 * BUDGET.behind * square
    rough = [(1.01, square), (5.0, 2.0 * square), (1.02, 2.0 * square), (8.0, hopeless)]
    promised = {"loop": [_Rough(width_of(value), promise) for value, promise in rough]}
    found = _in_other_valleys(cast("Any", None), fits, promised)
    assert fitted == others
    assert [x.training_square for x in found] == [1.0] * len(others)


@pytest.mark.parametrize(("left", "is_taken"), [(1.1, True), (1.4, True), (1.43, False), (3.0, False)])
def test_another_form_of_the_last_effect_counts_where_no_further_effect_is_sought(
    left: float, is_taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a gap that stays open a flexible form takes a part whatever is missing; that of an early effect is taken."""
    noise_um, places = 0.1, []

    def other_form(problem: Any, fitted: Any, index: int, *_: Any) -> Any:
        del problem
        places.append(index)
        return SimpleNamespace(hypothesis=fitted.hypothesis, rms_um=left * noise_um) if index == 1 else None

    monkeypatch.setattr(revise, "_with_other_values", lambda problem, fitted, noise_um: fitted)
    monkeypatch.setattr(revise, "at_aliases", lambda problem, fitted: fitted)
    monkeypatch.setattr(revise, "with_another_form", other_form)
    monkeypatch.setattr(revise, "rms_um", lambda fitted, problem, held=True: fitted.rms_um)
    two = width_of(1.0).plus(form("creep", "slow", False), (2.0,))
    before = cast("Any", SimpleNamespace(hypothesis=two, rms_um=5.0 * noise_um))
    found = looked_back(cast("Any", None), before, (), noise_um)
    assert places == [0, 1]
    assert (found is not before) is is_taken


@pytest.mark.parametrize(("left", "expected"), [(2.0, [1.0, 2.0]), (4.0, [1.0, 2.0, 3.0])])
def test_a_start_far_behind_the_best_is_not_fitted_roughly(
    left: float, expected: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It stays as it is, and is ranked. What the best start leaves counts, not what it promised."""
    fitted: list[float] = []

    def fit(problem: Any, hypothesis: Hypothesis, *_: Any, **__: Any) -> Any:
        del problem
        fitted.append(hypothesis.parts[-1].values[0])
        return SimpleNamespace(hypothesis=hypothesis, training_square=1.0)

    monkeypatch.setattr(step, "fit", fit)
    monkeypatch.setattr(step, "judge", lambda *_: SimpleNamespace(training_square=left))
    squares = {1.0: 2.0, 2.0: 1.9 * BUDGET.hopeless, 3.0: 2.1 * BUDGET.hopeless}
    starts = [(form("hysteresis", f"loop {value}", False), Start((value,), x)) for value, x in squares.items()]
    parent = cast("Any", SimpleNamespace(hypothesis=Hypothesis()))
    beside = cast("Any", SimpleNamespace(ridge=np.zeros(0), slopes=np.zeros((0, 0))))
    found = step._roughly(cast("Any", SimpleNamespace(observations=())), parent, starts, beside)
    assert sorted(fitted) == expected
    assert found["loop 3.0"][0].square == (1.0 if 3.0 in expected else 2.1 * BUDGET.hopeless)
