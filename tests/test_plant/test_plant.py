"""The chain of blocks: the laws of time and scale, parabolas and plays at their turns."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from plant_runs import run_plant, with_transducer

from bender_compiled.simulation import Drive, Simulator
from bender_plant.blocks import BLOCKS, Block
from bender_plant.composite_beam import natural_frequency_Hz, static_gain_um_per_V, static_share
from bender_plant.kernels.play import first_engagement, play
from bender_plant.model import Model, load_model
from bender_plant.parabola import INSTANT, cut, first_crossing, turning_point, value
from bender_plant.parameter import WIDEST, meanings
from bender_plant.plant import Plant

MICRON = 1e-3  # the contract's 1e-9 m, in um


def test_beam_model_against_the_modal_step_response() -> None:
    model = load_model("beam")
    assert model.beam is not None
    time = 0.01 * np.arange(1, 41)
    expected = np.zeros_like(time)
    rest = 1.0
    for mode in (1, 2, 3, 4):
        omega, zeta, share = 2 * math.pi * natural_frequency_Hz(model.beam, mode), 0.02, static_share(mode)
        omega_d = omega * math.sqrt(1 - zeta**2)
        swing = np.cos(omega_d * time) + zeta / math.sqrt(1 - zeta**2) * np.sin(omega_d * time)
        expected += share * (1 - np.exp(-zeta * omega * time) * swing)
        rest -= share
    expected = 50.0 * static_gain_um_per_V(model.beam) * (expected + rest)
    assert np.max(np.abs(run_plant(model, np.full(40, 50.0), 0.01) - expected)) < 1e-9


BOUC_WEN = {"terms": ("u'", "w |u'|", "|w| u'"), "coefficients": (0.8, -0.05, -0.02)}
DUHEM = {"terms": ("u'", "w |u'|", "u |u'|", "w", "u^2"), "coefficients": (0.4, -0.06, 0.03, -0.9, 0.004)}
HALVED = {
    **{name: load_model(name) for name in ("paper", "beam", "bench")},
    "plays": with_transducer("prandtl_ishlinskii"),
    "bouc-wen": with_transducer("bouc_wen"),
    "bouc-wen n=1.7": with_transducer("bouc_wen", exponent=1.7),
    "terms of bouc-wen": with_transducer("sparse_equation", **BOUC_WEN),
    "terms of duhem": with_transducer("sparse_equation", **DUHEM),
}


@pytest.mark.parametrize("model", HALVED.values(), ids=list(HALVED))
@pytest.mark.parametrize("step_s", [0.25, 1 / 30, 0.001])
def test_halving_the_step_changes_nothing(model: Model, step_s: float) -> None:
    voltages = np.array([0.0, 20.0, 45.0, 10.0, 10.0, 30.0, 0.0, 50.0, 50.0, -30.0, 25.0])
    whole, halves = run_plant(model, voltages, step_s), run_plant(model, voltages, step_s, parts=2)
    assert np.max(np.abs(whole - halves)) < MICRON


@settings(max_examples=20)
@given(st.lists(st.floats(0.0, 50.0), min_size=2, max_size=6), st.lists(st.floats(0.001, 0.2), min_size=2, max_size=6))
def test_uneven_steps_may_be_cut_anywhere(voltages: list[float], steps: list[float]) -> None:
    plant = Plant(load_model("bench"))
    whole = cut = plant.initial()
    a = b = 0.0
    for voltage, step_s in zip(voltages, steps, strict=False):
        whole, a, _ = plant.step(whole, voltage, 0.0, step_s)
        for part in (0.3, 0.7):
            cut, b, _ = plant.step(cut, voltage, 0.0, part * step_s)
        assert a == pytest.approx(b, abs=MICRON)


def test_rest_stays_at_rest() -> None:
    for name in ("paper", "beam", "bench"):
        assert np.all(run_plant(load_model(name), np.zeros(20), 0.05) == 0.0)


def test_equation_30_loop_width() -> None:
    block = BLOCKS["learned_hysteresis"]
    numbers = block.constants(block.parameters(), None)
    h = 0.002
    u = 10.0 * np.sin(math.pi * h / 2 * np.arange(10001) + 0.5)
    state, w = block.initial(numbers), []
    assert block.step is not None
    for k in range(0, 10000, 2):
        state, _, _, end = block.step(state, numbers, 0.0, h, u[k], u[k + 1], u[k + 2])
        w.append(end)
    drive, last = u[2::2][-1000:], np.array(w)[-1000:]
    rising = np.gradient(drive) > 0
    grid = np.linspace(-9.9, 9.9, 901)
    branches = [np.interp(grid, *np.array(sorted(zip(drive[s], last[s], strict=True))).T) for s in (rising, ~rising)]
    assert np.max(np.abs(branches[1] - branches[0])) == pytest.approx(3.077, abs=0.001)
    assert [last.min(), last.max()] == pytest.approx([-9.50, 8.17], abs=0.005)


@pytest.mark.parametrize(
    ("voltage", "step"), [(math.nan, 0.1), (math.inf, 0.1), (1.0, 0.0), (1.0, -1.0), (1.0, math.inf)]
)
def test_impossible_inputs_are_refused(voltage: float, step: float) -> None:
    plant = Plant(load_model("paper"))
    with pytest.raises(ValueError, match="expected finite"):
        plant.step(plant.initial(), voltage, 0.0, step)


@pytest.mark.parametrize("unit", [1e-3, 1e3, 1e6, 1e9])
def test_a_backlash_reads_the_same_in_any_unit(unit: float) -> None:
    time = np.arange(400) / 50.0
    command = 20.0 * np.sin(3.0 * time) + 5.0 * np.sin(17.0 * time)
    own, scaled = (
        Simulator(Drive(time, time, k * command, linear=True)).run(
            load_model("beam").with_block("backlash", half_width_um=3.0 * k)
        )
        for k in (1.0, unit)
    )
    np.testing.assert_allclose(scaled.reading_um, unit * own.reading_um, rtol=1e-6, atol=1e-6 * unit)


@pytest.mark.parametrize("block", BLOCKS.values(), ids=list(BLOCKS))
def test_no_number_of_a_device_is_bounded_by_the_unit_in_which_it_is_read(block: Block) -> None:
    for name, meaning in meanings(block.parameters).items():
        if any(x in meaning.unit for x in ("um", "V")) and not name.startswith("straight") and "far" not in name:
            assert meaning.low in (0.0, 1e-30, -WIDEST), name
            assert meaning.high in (0.0, WIDEST, 1e9), name


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


NEAR = 1e-6
VOLTS = st.floats(-60.0, 60.0)
RADII = st.lists(st.floats(0.0, 40.0), min_size=1, max_size=4)


@given(VOLTS, VOLTS, VOLTS, RADII, st.data())
@example(0.0, 5.0, 10.0, [5.0], None)
@example(0.0, 8.0, 0.0, [3.0], None)
@example(0.0, 0.0, 11.0, [1e-3, 1e-5], None)
def test_until_it_ends_every_play_stands_or_is_pushed(u0, um, u1, radii, data):
    outputs = [0.0] * len(radii) if data is None else [data.draw(VOLTS) for _ in radii]
    end = first_engagement(tuple(outputs), tuple(radii), u0, um, u1)
    assert 0.0 < end <= 1.0
    inside = np.array([value(u0, um, u1, x) for x in np.linspace(0.0, end, 202)[1:-1]])
    steps = np.diff(np.concatenate([[u0], inside, [value(u0, um, u1, end)]]))
    assert np.all(steps >= -NEAR) or np.all(steps <= NEAR)
    # what happens within an instant of the beginning is taken for it
    near = NEAR + 8.0 * INSTANT * float(np.ptp((u0, um, u1)))
    for output, radius in zip(outputs, radii, strict=True):
        at_start = play(output, u0, radius)
        pushed = (inside - radius > at_start + near) | (inside + radius < at_start - near)
        stands = (inside - radius < at_start - near) & (inside + radius > at_start + near)
        assert not (pushed.any() and stands.any())


@given(st.floats(0.1, 30.0), st.floats(-20.0, 20.0), st.floats(0.1, 40.0))
def test_a_play_engages_where_a_straight_input_has_crossed_its_slack(radius, start, rise):
    end = first_engagement((start,), (radius,), start, start + 0.5 * rise, start + rise)
    expected = radius / rise if NEAR < radius / rise < 1.0 - NEAR else 1.0
    assert abs(end - expected) < 1e-6
