"""The equation of a residual: what its terms add, at the beginning, the middle and the end of a sub-step."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_plant.blocks import BLOCKS

signal = st.floats(-20.0, 20.0)


@given(y_um=st.tuples(signal, signal, signal), h=st.floats(1e-3, 1.0), weight=st.floats(-0.1, 0.1))
def test_a_term_with_the_rate_of_the_displacement_has_the_slope_of_the_parabola(
    y_um: tuple[float, float, float], h: float, weight: float
) -> None:
    block = BLOCKS["residual_equation"]
    numbers = block.constants(block.parameters(gives="value", terms=("y'",), coefficients=(weight,)), None)
    assert block.step is not None
    _, *after = block.step(block.initial(numbers), numbers, 0.0, h, *y_um, 0.0, 0.0, 0.0)
    # y = a + b x + c x^2 through the three values, over x = t / h
    a, middle, end = y_um
    c = 2.0 * (a + end - 2.0 * middle)
    b = end - a - c
    slopes = [(b + 2.0 * c * x) / h for x in (0.0, 0.5, 1.0)]
    assert [x - y for x, y in zip(after, y_um, strict=True)] == pytest.approx([weight * x for x in slopes], abs=1e-6)
