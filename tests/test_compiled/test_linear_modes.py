"""Modes without loads but a spring: the run of their own gives what the run of any modes gives."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from bender_compiled.kernels import uncut_run
from bender_compiled.linear_modes import linear_modes_run, spring_alone
from bender_plant.blocks import BLOCKS
from bender_plant.composite_beam import CompositeBeam
from bender_plant.kernels.vibration_mode import STIFFNESS_LEVELS, nearest_level
from bender_plant.model import Model, load_model
from bender_plant.plant import effective_settings

MODES = BLOCKS["bending_modes"]
PAPER = load_model("paper")


def beam() -> CompositeBeam:
    """The beam of the paper."""
    assert PAPER.beam is not None
    return PAPER.beam


def modes_of(model: Model) -> tuple[tuple[float, ...], ...]:
    """The constants of a model's modes."""
    parameters = next(p for block, p in effective_settings(model) if block is MODES)
    return MODES.constants(parameters, beam())


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 3),
    zeta=st.floats(1e-6, 0.95),
    factor=st.floats(1e-3, 1e3),
    different=st.integers(1, 1000),
)
def test_a_run_of_their_own_equals_the_one_of_any_modes(
    seed: int, count: int, zeta: float, factor: float, different: int
) -> None:
    rng = np.random.default_rng(seed)
    shares = "beam" if count > 1 else "unity"
    parameters = MODES.parameters(count=count, shares=shares, damping_ratio=zeta, frequency_factor=factor)
    constants = MODES.constants(parameters, beam())
    state = rng.normal(size=2 * count + 1)
    # lengths that return, and with many different ones places of the table that are taken by another
    lengths_s = 10.0 ** rng.uniform(-9.0, 0.0, different)
    h = rng.choice(lengths_s, 600)
    w0, wm, w1 = rng.normal(size=(3, h.size))
    ours = linear_modes_run()(state, tuple(mode[:3] for mode in constants), (0.0, 0.0, 0.0), h, w0, wm, w1)
    theirs = uncut_run("bending_modes")(state, constants, np.cumsum(h), h, w0, wm, w1, w0, wm, w1)
    for mine, other in zip(ours, theirs, strict=True):
        scale = 1.0 + np.max(np.abs(other))
        assert np.max(np.abs(mine - other)) <= 1e-12 * scale


@settings(max_examples=20)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 3),
    cubic=st.sampled_from([0.0, 0.3, -0.002]),
    bend=st.floats(-0.5, 0.5),
    quadratic=st.floats(-0.02, 0.02),
)
def test_a_spring_on_the_first_of_them_gives_the_same_numbers(
    seed: int, count: int, cubic: float, bend: float, quadratic: float
) -> None:
    rng = np.random.default_rng(seed)
    parameters = MODES.parameters(count=count, shares="beam" if count > 1 else "unity", cubic_1_per_um2=cubic)
    parameters = parameters.loaded(bending_1_per_um2=bend, quadratic_1_per_um=quadratic)
    constants = MODES.constants(parameters, beam())
    h = rng.choice([1e-4, 3e-4, 7e-4], 600)
    w0, wm, w1 = rng.normal(size=(3, h.size))
    state = np.zeros(2 * count + 1)
    spring = spring_alone(constants)
    assert spring == (cubic, bend, quadratic)
    ours = linear_modes_run()(state, tuple(mode[:3] for mode in constants), spring, h, w0, wm, w1)
    theirs = uncut_run("bending_modes")(state, constants, np.cumsum(h), h, w0, wm, w1, w0, wm, w1)
    # a spring that softens may run away, and whatever rounding there was with it
    assume(np.max(np.abs(theirs[:3])) < 100.0)
    for mine, other in zip(ours, theirs, strict=True):
        assert np.max(np.abs(mine - other)) <= 1e-11 * (1.0 + np.max(np.abs(other)))


def test_any_other_load_takes_the_run_of_any_modes() -> None:
    loads = {
        "coulomb_friction": {"level_um": 0.1},
        "quadratic_drag": {"drag_1_per_um": 0.1},
        "hysteretic_spring": {"share": 0.1},
    }
    for block_id, parameters in loads.items():
        model = PAPER.with_block(block_id, **parameters)
        assert spring_alone(modes_of(model)) is None, block_id
    assert spring_alone(modes_of(PAPER)) == (0.0, 0.0, 0.0)
    stiff = PAPER.with_block("stiffening", cubic_1_per_um2=1e-4)
    assert spring_alone(modes_of(stiff)) == (1e-4, 0.0, 0.0)


@given(st.floats(0.1, 1e6))
def test_the_stiffness_of_a_sub_step_is_one_of_few(stiffness: float) -> None:
    level = nearest_level(stiffness)
    assert abs(level - stiffness) <= max(0.5 / STIFFNESS_LEVELS, 1e-9 * stiffness)
    assert level * STIFFNESS_LEVELS == round(level * STIFFNESS_LEVELS) >= 1


@pytest.mark.parametrize("stiffness", [math.inf, math.nan, 2e9])
def test_a_stiffness_that_runs_away_is_left_as_it_is(stiffness: float) -> None:
    assert nearest_level(stiffness) == pytest.approx(stiffness, nan_ok=True)


@pytest.mark.parametrize(("cubic", "bend"), [(1e-3, 0.0), (3e-3, 1e-2), (5e-4, -5e-3)])
def test_ever_shorter_sub_steps_come_to_one_motion_at_any_stiffness(cubic: float, bend: float) -> None:
    """Halving them takes the error to a sixth at most: more than the third order, though the level may jump."""
    omega, volts = 2600.0, np.random.default_rng(3).uniform(0.0, 20.0, 40).repeat(90)

    def ends(pieces: int) -> np.ndarray:
        h = np.full(volts.size * pieces, 0.12 / omega / pieces)
        w = volts.repeat(pieces)
        found = linear_modes_run()((0.0, 0.0, 0.0), ((omega, 0.02, 1.0),), (cubic, bend, 0.0), h, w, w, w)
        return found[2][pieces - 1 :: pieces]

    finest = ends(16)
    coarse, fine = (float(np.sqrt(np.mean((ends(x) - finest) ** 2))) for x in (1, 2))
    assert coarse < 1e-4
    assert fine < coarse / 6.0
