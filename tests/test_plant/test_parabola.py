"""Cutting parabolas: what is cut is the same curve, and crossings and turns are found where they are."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from bender_plant.parabola import cut, first_crossing, turning_point, value

number = st.floats(-50.0, 50.0)
fraction = st.floats(0.01, 0.99)


@given(number, number, number)
def test_a_parabola_passes_its_three_points(u0: float, um: float, u1: float) -> None:
    assert [value(u0, um, u1, x) for x in (0.0, 0.5, 1.0)] == pytest.approx([u0, um, u1], abs=1e-9)


@given(number, number, number, fraction, fraction)
def test_the_parts_lie_on_the_whole(u0: float, um: float, u1: float, at: float, x: float) -> None:
    left, middle, right, end = cut(u0, um, u1, at)
    assert value(u0, left, middle, x) == pytest.approx(value(u0, um, u1, x * at), abs=1e-9)
    assert value(middle, right, end, x) == pytest.approx(value(u0, um, u1, at + x * (1 - at)), abs=1e-9)


@given(number, number, number, number)
def test_the_first_crossing_is_where_the_sign_first_changes(u0: float, um: float, u1: float, level: float) -> None:
    # what happens within an instant of the ends is no business of a cut
    x = np.linspace(1e-5, 1.0 - 1e-5, 2001)
    curve = np.array([value(u0, um, u1, at) for at in x])
    above = curve > level
    changes = np.nonzero(above[1:] != above[:-1])[0]
    assume(abs(u0 - level) > 1e-6)
    assume(abs(u1 - level) > 1e-6)
    found = first_crossing(u0, um, u1, level)
    if found < 1.0:
        assert value(u0, um, u1, found) == pytest.approx(level, abs=1e-6)
        assert not np.any(x[changes] < found - 1e-3)
    else:
        # a touch is no passing
        beyond = (curve - level) * np.sign(level - curve[0])
        assert beyond.max() < 1e-6


@given(number, number, number)
def test_a_parabola_turns_where_its_slope_is_zero(u0: float, um: float, u1: float) -> None:
    at = turning_point(u0, um, u1)
    if at < 1.0:
        peak = value(u0, um, u1, at)
        assert (peak - u0) * (peak - u1) > 0.0
    else:
        rises = np.diff([value(u0, um, u1, x) for x in np.linspace(0.0, 1.0, 101)])
        assert rises.max() <= 1e-4 or rises.min() >= -1e-4


def test_standing_on_the_level_is_no_crossing() -> None:
    assert first_crossing(1.0, 2.0, 3.0, 1.0) == 1.0
    assert first_crossing(3.0, 2.0, 1.0, 1.0) == 1.0
    assert first_crossing(0.0, 1.0, 0.0, 0.0) == 1.0
    # leaves the level, comes back through it and goes on
    assert first_crossing(0.0, 1.0, -6.0, 0.0) == pytest.approx(0.625)


def test_the_end_of_one_cut_does_not_call_for_the_next() -> None:
    # slope and bend of rounding size at the start: the remainder of a cut at a turning point
    assert first_crossing(23.239842862624958, 23.239843522200143, 23.239845500925714, 23.239842862624958) == 1.0


def test_a_line_that_starts_on_the_level_does_not_cross_it() -> None:
    # a bend of rounding size puts the second root far before the start
    u0, u1 = 3.526305469847557e-08, 4.1748826618004387e-11
    for level in (u0, u0 - 1.8e-15, u0 + 1.8e-15):
        assert first_crossing(u0, 1.7652401762546788e-08, u1, level) == 1.0
