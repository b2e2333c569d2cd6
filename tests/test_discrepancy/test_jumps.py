"""Numbers whose misfit changes in jumps: the deepest place, the middle of equal fits, other numbers beside them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import hypothesis, levels, record_of

from bender_discrepancy.fitting.fit_problem import problem_of
from bender_discrepancy.fitting.output_error import Fitted, fit, judge
from bender_discrepancy.fitting.scans.jumps import FINER_AND_FINER, middle_of_equal_fits, minimise_in_jumps
from bender_discrepancy.records.observations import observe
from bender_plant.model import load_model

STEP_V = 4.386


@given(st.floats(0.01, 100.0), st.floats(-0.9, 0.9), st.floats(3.0, 300.0))
@examples(max_examples=60, deadline=None)
def test_a_value_is_moved_to_where_a_stair_of_squares_is_deepest(start: float, place: float, stairs: float) -> None:
    deepest = start * (1.0 + place * FINER_AND_FINER[0])
    height = FINER_AND_FINER[0] / stairs

    def square_at(value: float) -> float:
        return float(np.floor(abs(value / deepest - 1.0) / height))

    value, square = minimise_in_jumps(start, square_at(start), square_at)
    assert square == square_at(value) <= square_at(start)
    assert abs(value / deepest - 1.0) <= max(height, 2.0 * FINER_AND_FINER[-1])


@given(st.floats(0.01, 100.0), st.floats(2e-5, 5e-4), st.floats(0.05, 0.95))
@examples(max_examples=60, deadline=None)
def test_of_what_fits_alike_the_middle_is_taken(low: float, width: float, place: float) -> None:
    high = low * (1.0 + width)
    value = low + place * (high - low)
    middle = middle_of_equal_fits(value, 1.0, lambda x: 0.5 if low <= x <= high else 2.0)
    assert abs(middle - 0.5 * (low + high)) <= 0.2 * (high - low)


def test_a_middle_that_fits_worse_is_not_taken() -> None:
    assert middle_of_equal_fits(1.0, 1.0, lambda x: 0.5 if x == 1.0 or x > 1.00001 else 2.0) == 1.0


def _beside_creep(start_V: float, seed: int = 7) -> tuple[Fitted, Fitted]:
    """Return a fit of steps of the supply, damping and creep that sets out from other numbers, and the true ones."""
    volts = levels(40.0)
    slow = {"gains": (0.08,), "time_constants_s": (1.2,)}
    effects = {
        "supply_quantisation": {"step_V": STEP_V},
        "creep": slow,
        "structural_damping": {"damping_ratio": 0.0247},
    }
    record = record_of("beam", effects, volts, seed=seed)
    beam = load_model("beam")
    problem = problem_of(beam, (observe(record),))

    def parts(step_V: float, gain: float, tau_s: float, damping: float) -> Fitted | None:
        steps, crept = ("supply_quantisation", (step_V,)), ("1 relaxation", (gain, tau_s))
        told = hypothesis(beam, [record], steps, crept, ("structural_damping", (damping,)))
        return fit(problem, told) if step_V != STEP_V else judge(problem, told)

    found, true = parts(start_V, 0.03, 0.5, 0.02), parts(STEP_V, 0.08, 1.2, 0.0247)
    assert found is not None
    assert true is not None
    return found, true


@pytest.mark.parametrize("off", [-6e-4, 3e-4, 8e-4])
def test_steps_of_the_supply_do_not_keep_the_numbers_beside_them_from_theirs(off: float) -> None:
    found, true = _beside_creep(STEP_V * (1.0 + off))
    assert found.training_square <= 1.01 * true.training_square
    assert found.held_square <= 1.05 * true.held_square
    step_V, gain, tau_s, damping = found.hypothesis.values()
    assert math.isclose(step_V, STEP_V, rel_tol=2e-3)
    assert math.isclose(gain, 0.08, rel_tol=0.05)
    assert math.isclose(tau_s, 1.2, rel_tol=0.1)
    assert math.isclose(damping, 0.0247, rel_tol=0.05)
    assert found.covariance is not None
