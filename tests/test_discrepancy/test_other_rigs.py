"""Models that people write for their own rigs: linear ones, whose effects differ by a sign or by nothing at all."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import levels, record_of
from scipy.optimize import lsq_linear

from bender_discrepancy.effects.catalogue import forms
from bender_discrepancy.effects.effect import FULL_VOLTAGE_V, FULL_STROKE_um, Sizes, powers_of_unit, scaling
from bender_discrepancy.fitting.starts import solved_with_signs
from bender_discrepancy.fitting.visible_modes import without_unseen_modes
from bender_discrepancy.records.observations import observe
from bender_discrepancy.workflow import search_records
from bender_loop.errors import InputError
from bender_loop.records.record import Record
from bender_plant.blocks import BLOCKS
from bender_plant.model import load_model
from bender_plant.parameter import meanings


def with_a_long_hold() -> np.ndarray:
    return np.concatenate([levels(40.0), np.full(600, 40.0), np.zeros(300)])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "parameters"),
    [
        ("creep", {"gains": (0.1,), "time_constants_s": (5.0,)}),
        ("charge_leakage", {"fraction": 0.15, "time_constant_s": 5.0}),
    ],
)
def test_on_a_linear_model_growth_is_creep_and_sag_is_leakage(hidden: str, parameters: dict[str, Any]):
    record = record_of("beam", {hidden: parameters}, with_a_long_hold())
    found = search_records(load_model("beam"), [record])
    assert found.verdict.word == "named"
    assert found.best.hypothesis.effects == (hidden,)


def seen_at(rate_Hz: float) -> Record:
    """A step after half of the rows, through the ringing of all modes of the beam at a vibrometer's rates."""
    slow = record_of("beam", voltage_V=np.repeat([0.0, 30.0, 10.0, 40.0], 200))
    return Record(slow.time_s * 30.0 / rate_Hz, slow.voltage_V, slow.displacement_um)


def modes_of(record: Record) -> int:
    model = without_unseen_modes(load_model("beam"), [observe(record)])
    return next(x.parameters.count for x in model.blocks if x.id == "bending_modes")


def test_a_camera_sees_one_mode_a_vibrometer_more():
    assert modes_of(seen_at(30.0)) == 1
    assert modes_of(seen_at(20_000.0)) > 1


def test_a_model_of_one_mode_stays_as_it_is():
    model = load_model("paper")
    assert without_unseen_modes(model, [observe(record_of())]) is model


@pytest.mark.slow
def test_records_too_long_for_the_model_are_refused_with_what_to_do():
    """A row a minute for days: every effect would stay untried, and nothing could be said about any."""
    slow = record_of()
    hours = Record(slow.time_s * 7200.0, slow.voltage_V, slow.displacement_um)
    with pytest.raises(InputError, match=r"sub-steps of 0\.0043 s as the model paper needs.*--untimed"):
        search_records(load_model("paper"), [hours])


@examples(max_examples=60)
@given(st.integers(0, 10_000), st.lists(st.booleans(), min_size=1, max_size=5))
def test_weights_that_must_not_be_negative_are_the_best_of_those(seed: int, signs: list[bool]):
    rng = np.random.default_rng(seed)
    positive = np.array([False, *signs])
    columns = [rng.standard_normal(40) for _ in positive]
    measured = 3.0 * columns[0] + sum(rng.normal() * x for x in columns[1:]) + rng.standard_normal(40)
    weights, square = solved_with_signs(columns, measured, positive)
    sign = np.sign(columns[0] @ measured)
    assert np.all(sign * weights[positive] >= 0.0)
    low = np.where(positive & (sign > 0.0), 0.0, -np.inf)
    high = np.where(positive & (sign < 0.0), 0.0, np.inf)
    best = lsq_linear(np.stack(columns, axis=1), measured, (low, high), tol=1e-12)
    assert square == pytest.approx(2.0 * best.cost, rel=1e-6)
    assert square == pytest.approx(float(np.sum((measured - np.stack(columns, axis=1) @ weights) ** 2)), rel=1e-9)


@pytest.mark.parametrize("factor", [(1e4, 1.0), (1.0, 1e-4), (1e3, 1e5)])
def test_what_has_a_size_is_sought_in_proportion_to_the_rig(factor: tuple[float, float]) -> None:
    usual = Sizes(FULL_VOLTAGE_V, FULL_STROKE_um, 100.0, 50.0, piezo_bender=False, highest_Hz=50.0)
    large = replace(usual, span_V=factor[0] * usual.span_V, stroke_um=factor[1] * usual.stroke_um)
    seen = 0
    for first, second in zip(forms(usual), forms(large), strict=True):
        for one, other in zip(first.free, second.free, strict=True):
            unit = _unit(first.effect, one.name)
            if unit is None or powers_of_unit(unit) == (0, 0):
                continue
            times = scaling(unit, large.span_V, large.stroke_um)
            np.testing.assert_allclose(other.starts, times * np.array(one.starts), rtol=1e-9)
            if not one.solved:
                bounds = other.low, other.high
                assert bounds == pytest.approx((times * one.low, times * one.high)), (first.name, one.name)
            seen += 1
    assert seen > 15


def _unit(effect: str, name: str) -> str | None:
    """Return the unit of a parameter of a block; None for a number that the form makes up for itself."""
    found = meanings(BLOCKS[effect].parameters).get(name.partition("[")[0])
    return None if found is None else found.unit
