import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.control.pid import Gains
from bender_tuner.task.search_space import RawSpace, SearchSpace

CENTER = Gains(0.25, 6.0, 0.002, filter_time_s=0.07)
UNIT = st.floats(0.0, 1.0)
GAIN = st.floats(1e-6, 1e4)


def test_the_centre_is_the_guess_and_the_edges_lie_the_decades_away() -> None:
    space = SearchSpace(CENTER, decades=2.0)
    assert space.to_gains([0.5, 0.5, 0.5]) == CENTER
    edge = space.to_gains([1.0, 0.0, 0.5])
    assert edge.proportional_V_per_um == pytest.approx(25.0)
    assert edge.integral_V_per_um_s == pytest.approx(0.06)
    assert edge.filter_time_s == 0.07


@given(x=st.tuples(UNIT, UNIT, UNIT))
def test_points_come_back_from_their_gains(x: tuple[float, float, float]) -> None:
    space = SearchSpace(CENTER)
    assert space.from_gains(space.to_gains(x)) == pytest.approx(np.array(x), abs=1e-12)


@given(factor=st.floats(0.05, 20.0), x=st.tuples(UNIT, UNIT, UNIT))
def test_scaling_the_centre_scales_all_gains(factor: float, x: tuple[float, float, float]) -> None:
    scaled = Gains(0.25 * factor, 6.0 * factor, 0.002 * factor)
    one, other = SearchSpace(CENTER).to_gains(x), SearchSpace(scaled).to_gains(x)
    assert other.integral_V_per_um_s == pytest.approx(factor * one.integral_V_per_um_s)
    assert other.derivative_V_s_per_um == pytest.approx(factor * one.derivative_V_s_per_um)


def test_gains_outside_the_box_lie_outside_and_zero_infinitely_far() -> None:
    x = SearchSpace(CENTER).from_gains(Gains(0.0, 6.0, 0.2))
    assert x[0] == -math.inf
    assert x[1] == pytest.approx(0.5)
    assert x[2] > 1.0


@pytest.mark.parametrize("x", [[0.5, 0.5], [0.5, 0.5, 1.01], [-0.01, 0.5, 0.5], [0.5, math.nan, 0.5]])
def test_points_outside_the_cube_are_refused(x: list[float]) -> None:
    with pytest.raises(ValueError, match="x must"):
        SearchSpace(CENTER).to_gains(x)


def test_a_last_digit_beyond_the_edge_is_the_edge() -> None:
    space = SearchSpace(CENTER)
    assert space.to_gains([1.0 + 1e-12, 0.0, 0.0]) == space.to_gains([1.0, 0.0, 0.0])


def test_settings_are_checked() -> None:
    with pytest.raises(ValueError, match=r"center\.proportional_V_per_um must be > 0"):
        SearchSpace(Gains(0.0, 1.0, 1.0))
    with pytest.raises(ValueError, match="decades"):
        SearchSpace(CENTER, decades=0.0)
    with pytest.raises(ValueError, match="scale"):
        RawSpace((1.0, 0.0, 1.0))


@given(gains=st.tuples(GAIN, GAIN, GAIN))
def test_raw_space_is_linear_and_without_upper_bound(gains: tuple[float, float, float]) -> None:
    space = RawSpace((2.0, 10.0, 0.5))
    found = space.to_gains(np.array(gains) / np.array([2.0, 10.0, 0.5]))
    assert found.proportional_V_per_um == pytest.approx(gains[0])
    assert space.from_gains(found) == pytest.approx(np.array(gains) / np.array([2.0, 10.0, 0.5]))
    assert found.derivative_on_error
    assert found.filter_time_s == 0.0


def test_raw_space_has_no_gains_below_zero() -> None:
    with pytest.raises(ValueError, match="integral_V_per_um_s"):
        RawSpace().to_gains([0.1, -0.1, 0.0])
