"""An FMU that is not linear, followed: numbers that come nearer by one part at every turn lead to where they end."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_discrepancy.effects.form import Form, Free
from bender_discrepancy.fitting.hypothesis import Hypothesis, Part
from bender_discrepancy.foreign.space_mapping import extrapolate_values

WIDE = Hypothesis((Part(Form("any", "any", (Free("x", -100.0, 100.0, False, (0.0,), 1.0),), lambda m, _: m), (0.0,)),))


@given(
    st.floats(-50.0, 50.0),
    st.floats(-20.0, 20.0).filter(lambda x: abs(x) > 1e-2),
    st.floats(-0.9, 0.9).filter(lambda x: abs(x) > 1e-2),
)
def test_numbers_that_come_nearer_by_the_same_part_lead_to_their_limit(limit: float, off: float, part: float) -> None:
    first, second, third = ((limit + off * part**k,) for k in range(3))
    assert extrapolate_values(WIDE, first, second, third).values()[0] == pytest.approx(
        limit, abs=1e-6 * (1.0 + abs(limit))
    )


def test_where_they_lead_beyond_a_bound_the_bound_is_meant_and_at_rest_they_stay() -> None:
    assert extrapolate_values(WIDE, (0.0,), (60.0,), (119.0,)).values() == (100.0,)
    assert extrapolate_values(WIDE, (3.0,), (3.0,), (3.0,)).values() == (3.0,)
