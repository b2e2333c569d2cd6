"""Plays, Bouc-Wen and an equation of terms: the laws of rate-independent hysteresis, and independent solutions."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from few import few
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bender_plant.blocks import BLOCKS, bouc_wen, prandtl_ishlinskii
from bender_plant.kernels.bouc_wen import along
from bender_plant.parameter import ModelError

OPERATORS: list[tuple[str, dict[str, Any]]] = [
    ("prandtl_ishlinskii", {}),
    ("bouc_wen", {}),
    ("bouc_wen", {"exponent": 2.0, "linear_gain_um_per_V": 0.1}),
    ("bouc_wen", {"alpha_um_per_V": 0.3, "gamma_1_per_V": -0.05}),
    ("sparse_equation", {"terms": ("u'", "w |u'|", "|w| u'"), "coefficients": (0.8, -0.05, -0.02)}),
]
voltage = st.floats(-50.0, 50.0)


def operate(block_id: str, parameters: dict[str, Any], path: list[float]) -> list[float]:
    """Outputs along a path of voltages, each reached in one monotone stretch."""
    block = BLOCKS[block_id]
    numbers = block.constants(block.parameters(**parameters), None)
    state, outputs = block.initial(numbers), []
    assert block.step is not None
    for u in path:
        state, _, _, y = block.step(state, numbers, 0.0, 1.0, u, u, u)
        outputs.append(y)
    return outputs


@pytest.mark.parametrize(("block_id", "parameters"), OPERATORS)
@given(path=st.lists(voltage, min_size=1, max_size=6), u=voltage, part=st.floats(0.0, 1.0))
def test_a_monotone_stretch_may_be_cut_anywhere(
    block_id: str, parameters: dict[str, Any], path: list[float], u: float, part: float
) -> None:
    between = path[-1] + part * (u - path[-1])
    one = operate(block_id, parameters, [*path, u])[-1]
    assert operate(block_id, parameters, [*path, between, u])[-1] == pytest.approx(one, abs=1e-6)


@given(path=st.lists(voltage, min_size=1, max_size=8), linear=st.floats(-1.0, 1.0))
def test_plays_against_their_definition(path: list[float], linear: float) -> None:
    """Each is pushed by one wall or the other, else at rest; that minor loops are wiped out follows from it."""
    thresholds, weights = (1.0, 5.0, 12.0), (0.3, -0.1, 0.2)
    parameters = {"linear_gain_um_per_V": linear, "thresholds_V": thresholds, "weights_um_per_V": weights}
    plays, expected = [0.0] * 3, []
    for u in path:
        plays = [min(max(x, u - r), u + r) for x, r in zip(plays, thresholds, strict=True)]
        expected.append(linear * u + sum(p * x for p, x in zip(weights, plays, strict=True)))
    assert operate("prandtl_ishlinskii", parameters, path) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("block_id", "parameters"), OPERATORS)
@given(path=st.lists(voltage, min_size=1, max_size=6))
def test_odd_symmetry(block_id: str, parameters: dict[str, Any], path: list[float]) -> None:
    mirrored = operate(block_id, parameters, [-u for u in path])
    assert [-y for y in mirrored] == pytest.approx(operate(block_id, parameters, path), abs=1e-9)


@given(path=st.lists(voltage, min_size=1, max_size=6), power=st.sampled_from([1, 2, 3]), weight=st.floats(-0.1, 0.1))
def test_each_power_of_a_play_adds_what_it_lags_behind_that_power_of_the_voltage(
    path: list[float], power: int, weight: float
) -> None:
    half_V = 5.0
    names = {1: "weights_um_per_V", 2: "quadratic_um_per_V2", 3: "cubic_um_per_V3"}
    block = BLOCKS["rate_independent_hysteresis"]
    weights = {"weights_um_per_V": (0.0,)} | {names[power]: (weight,)}
    numbers = block.constants(block.parameters(thresholds_V=(half_V,), **weights), None)
    assert block.step is not None
    state, play_V = block.initial(numbers), 0.0
    for u in path:
        play_V = min(max(play_V, u - half_V), u + half_V)
        state, *added_um = block.step(state, numbers, 0.0, 1.0, 0.0, 0.0, 0.0, u, u, u)
        assert added_um == pytest.approx([weight * (play_V**power - u**power)] * 3, abs=1e-9)


@given(
    path=st.lists(voltage, min_size=1, max_size=6),
    reached_V=st.floats(-30.0, 30.0),
    quadratic=st.floats(-0.01, 0.01),
)
def test_plays_in_use_begin_as_virgin_ones_that_were_driven_before(
    path: list[float], reached_V: float, quadratic: float
) -> None:
    block = BLOCKS["rate_independent_hysteresis"]
    assert block.step is not None
    many = {"thresholds_V": (3.0, 9.0), "weights_um_per_V": (0.1, 0.2), "quadratic_um_per_V2": (quadratic, 0.0)}
    used = block.constants(block.parameters(**many, reached_V=reached_V), None)
    virgin = block.constants(block.parameters(**many), None)
    state, before = block.initial(used), block.initial(virgin)
    for u in (reached_V, 0.0):
        before, *rest = block.step(before, virgin, 0.0, 1.0, 0.0, 0.0, 0.0, u, u, u)
    # it reads nothing at rest
    assert block.step(state, used, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)[1:] == pytest.approx((0.0,) * 3, abs=1e-12)
    for u in path:
        state, *added = block.step(state, used, 0.0, 1.0, 0.0, 0.0, 0.0, u, u, u)
        before, *expected = block.step(before, virgin, 0.0, 1.0, 0.0, 0.0, 0.0, u, u, u)
        assert np.subtract(expected, added) == pytest.approx(rest, abs=1e-9)


@pytest.mark.parametrize("exponent", few([1.0, 1.5, 3.0], 1))
@pytest.mark.parametrize("printed", [False, True])
def test_bouc_wen_against_solve_ivp(exponent: float, printed: bool) -> None:
    alpha, beta, gamma = 10.0, 0.75, 0.5

    def rate(t: float, h: np.ndarray) -> list[float]:
        du, magnitude = math.cos(t), abs(h[0])
        last = gamma * du if printed else gamma * du * magnitude**exponent
        return [alpha * du - beta * abs(du) * magnitude ** (exponent - 1) * h[0] - last]

    parameters = {
        "linear_gain_um_per_V": 0.0, "alpha_um_per_V": alpha, "beta_1_per_V": beta,
        "gamma_1_per_V": gamma, "exponent": exponent, "printed": printed,
    }  # fmt: skip
    h, ours = np.zeros(1), []
    turns = [0.0, math.pi / 2, 1.5 * math.pi, 2.5 * math.pi, 3.0 * math.pi]
    for begin, end in pairwise(turns):
        h = solve_ivp(rate, (begin, end), h, "DOP853", rtol=1e-11, atol=1e-12, max_step=0.01).y[:, -1]
        ours = operate("bouc_wen", parameters, [math.sin(t) for t in turns[1:] if t <= end])
        assert ours[-1] == pytest.approx(h[0], abs=2e-6)


@given(h=st.floats(-3.0, 3.0), a=st.floats(-9.0, 9.0), alpha=st.floats(-2.0, 2.0), gamma=st.floats(-0.4, 0.4))
def test_bouc_wen_closed_form_equals_integration(h: float, a: float, alpha: float, gamma: float) -> None:
    exact = along(h, a, alpha, 0.4, gamma, 1.0)
    fine = h
    for _ in range(400):
        fine = along(fine, a / 400, alpha, 0.4, gamma, 1.0 + 1e-12)
    assert exact == pytest.approx(fine, abs=1e-5)


def test_impossible_operators_are_refused() -> None:
    with pytest.raises(ModelError, match="expected \\|gamma\\| <= beta"):
        bouc_wen.Parameters(gamma_1_per_V=0.2)
    with pytest.raises(ModelError, match="the same number of each"):
        prandtl_ishlinskii.Parameters(thresholds_V=(1.0,))
    with pytest.raises(ModelError, match="growing values"):
        prandtl_ishlinskii.Parameters(thresholds_V=(2.0, 1.0), weights_um_per_V=(0.1, 0.1))
