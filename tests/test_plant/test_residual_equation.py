"""The equation of a residual: what its terms add, at the beginning, the middle and the end of a sub-step."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bender_plant.blocks import BLOCKS

signal = st.floats(-20.0, 20.0)
positive = st.floats(0.5, 20.0)


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


RATE_TERMS: dict[str, Callable[[float, float, float, float], float]] = {
    "1": lambda v, y, dv, dy: 1.0,
    "v": lambda v, y, dv, dy: v,
    "|v|": lambda v, y, dv, dy: abs(v),
    "v y": lambda v, y, dv, dy: v * y,
    "v'": lambda v, y, dv, dy: dv,
    "v |v'|": lambda v, y, dv, dy: v * abs(dv),
    "y v'": lambda v, y, dv, dy: y * dv,
    "v^2 y'": lambda v, y, dv, dy: v * v * dy,
    "|y'|": lambda v, y, dv, dy: abs(dy),
}


@pytest.mark.parametrize("term", RATE_TERMS)
@given(
    last=st.tuples(positive, positive),
    ends=st.tuples(positive, positive, positive, positive),
    h=st.floats(0.01, 0.1),
)
def test_a_rate_is_integrated_over_a_jump_and_along_the_sub_step(
    term: str, last: tuple[float, float], ends: tuple[float, float, float, float], h: float
) -> None:
    """Oracle: the differential equation, first over the jump, in which no time passes, then over straight signals."""
    v0, y0, v1, y1 = ends
    # with anything but a constant, a decay is of second order in the sub-step
    decay_per_s = 0.8 if term == "1" else 0.0
    block = BLOCKS["residual_equation"]
    settings = block.parameters(gives="rate", terms=(term, "r"), coefficients=(0.1, -decay_per_s))
    numbers = block.constants(settings, None)
    assert block.step is not None
    y, v = (y0, 0.5 * (y0 + y1), y1), (v0, 0.5 * (v0 + v1), v1)
    assert block.corner is None or block.corner((0.0, *last), numbers, h, *y, *v) == 1.0
    (end, *_), *after = block.step((0.3, *last), numbers, 0.0, h, *y, *v)

    def integral(r: float, begin: tuple[float, float], end: tuple[float, float], over_s: float, to_s: float) -> float:
        """Without a duration only terms with a rate go on, here once from 0 to 1."""
        dv, dy = ((y - x) / (over_s or 1.0) for x, y in zip(begin, end, strict=True))

        def slope(t: float, r: np.ndarray) -> np.ndarray:
            here = 0.1 * RATE_TERMS[term](begin[0] + dv * t, begin[1] + dy * t, dv, dy)
            return np.array([(here if over_s or "'" in term else 0.0) - (decay_per_s * r[0] if over_s else 0.0)])

        return float(solve_ivp(slope, (0.0, to_s), [r], rtol=1e-10, atol=1e-10).y[0, -1])

    first = integral(0.3, last, (v0, y0), 0.0, 1.0)
    expected = [first, *(integral(first, (v0, y0), (v1, y1), h, part * h) for part in (0.5, 1.0))]
    assert [*(x - z for x, z in zip(after, y, strict=True)), end] == pytest.approx(
        [*expected, expected[-1]], rel=1e-7, abs=1e-7
    )


@pytest.mark.parametrize(("term", "turns"), [("v'", None), ("|v'|", 0), ("y'", None), ("|y'|", 1)])
@given(places=st.tuples(st.floats(0.1, 0.9), st.floats(0.1, 0.9)))
def test_a_sub_step_ends_where_the_signal_turns_whose_magnitude_of_rate_counts(
    term: str, turns: int | None, places: tuple[float, float]
) -> None:
    block = BLOCKS["residual_equation"]
    numbers = block.constants(block.parameters(gives="rate", terms=(term,), coefficients=(0.1,)), None)
    v, y = ([(x - place) ** 2 for x in (0.0, 0.5, 1.0)] for place in places)
    assert block.corner is not None
    found = block.corner(block.initial(numbers), numbers, 0.1, *y, *v)
    assert found == (1.0 if turns is None else pytest.approx(places[turns]))
