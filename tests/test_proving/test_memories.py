"""Hysteresis and creep: laws, brute force and closed forms."""

from itertools import pairwise

import numpy as np
import pytest
from bender_proving.physics import duhem, preisach, spectra
from bender_proving.cases.effects import INSIDE
from bender_proving.physics.grid import build_grid
from bender_proving.cases.hidden import Setting
from bender_proving.physics.lobatto import lag
from bender_proving.physics.material import after
from bender_proving.cases.nominal import FULL_STROKE_UM
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import cauchy, norm

CAMERA = Setting("camera", 30.0, 170.0)
HYSTERESIS = INSIDE["rate_independent_hysteresis"]
CREEP = INSIDE["creep"]
PATHS = st.lists(st.floats(0.0, 50.0), min_size=2, max_size=12)
RELAYS = preisach.relays("gauss", 4.0, 3.0, 25.0, 15.0)


def remembered(path: NDArray) -> NDArray:
    return preisach.respond(RELAYS.everett, RELAYS.virgin, np.asarray(path, dtype=np.float64))


def as_signal(path: NDArray, form: str, magnitude: float = 0.2) -> NDArray:
    """Added displacement along a path, four new points for each sub-step."""
    padded = np.concatenate([path, np.full(-(len(path) - 1) % 4, path[-1])])
    starts = np.arange(0, len(padded) - 1, 4)
    volts = np.stack([padded[k : k + 5] for k in starts])
    hidden = HYSTERESIS.hide(form, magnitude, CAMERA, np.random.default_rng(3))
    grid = build_grid(np.array([0.0, 1.0]), np.empty(0), 0.0, 1.0 / len(starts))
    return np.append(after(hidden, np.zeros_like(volts), volts, grid)[:, :-1], [0.0])[: len(path)]


@pytest.mark.parametrize("law", ["gauss", "lorentz"])
def test_preisach_agrees_with_a_crowd_of_relays(law: str):
    shape = {"gauss": norm, "lorentz": cauchy}[law]
    r, c = np.meshgrid(np.arange(0.05, 64.0, 0.1), np.arange(-64.95, 65.0, 0.1), indexing="ij")
    weight = shape.pdf((r - 4.0) / 3.0) * shape.pdf((c - 25.0) / 15.0) / 15.0
    ladder = shape.pdf((np.arange(0.0, 64.1, 0.25) - 4.0) / 3.0)
    weight *= 0.1 * 0.1 / (ladder.sum() * 0.25)
    state = np.where(c > 0.0, -1.0, 1.0)
    start, expected = np.sum(weight * state), []
    path = np.array([40.0, 12.0, 30.0, 22.0, 26.0, 5.0, 48.0, 0.0, 20.0])
    for v in path:
        state = np.where(c + r <= v, 1.0, np.where(c - r >= v, -1.0, state))
        expected.append(np.sum(weight * state) - start)
    tables = preisach.relays(law, 4.0, 3.0, 25.0, 15.0)
    found = preisach.respond(tables.everett, tables.virgin, path)
    np.testing.assert_allclose(found, expected, atol=0.02 * np.ptp(expected))


@given(path=PATHS)
def test_preisach_keeps_the_extrema_only(path: list[float]):
    points = np.array([0.0, *path])
    dense = np.concatenate([np.linspace(a, b, 9)[1:] for a, b in pairwise(points)])
    np.testing.assert_allclose(remembered(dense)[7::8], remembered(points)[1:], atol=1e-9)


@given(path=PATHS, low=st.floats(0.0, 50.0), high=st.floats(0.0, 50.0))
def test_a_closed_minor_loop_is_wiped_out(path: list[float], low: float, high: float):
    end = path[-1]
    turn = low if abs(low - end) > abs(high - end) else high
    between = 0.5 * (turn + end)
    there = np.array([*path, turn])
    with_loop = np.array([*path, between, end + 0.2 * (between - end), turn])
    assert remembered(with_loop)[-1] == pytest.approx(remembered(there)[-1], abs=1e-9)


@given(path=PATHS, other=PATHS, low=st.floats(0.0, 24.0), height=st.floats(0.5, 25.0))
def test_minor_loops_between_the_same_voltages_are_congruent(
    path: list[float], other: list[float], low: float, height: float
):
    loop = [low + height, low, low + height]
    first, second = remembered(np.array([*path, *loop])), remembered(np.array([*other, *loop]))
    np.testing.assert_allclose(first[-1] - first[-2], second[-1] - second[-2], atol=1e-9)


@given(path=PATHS, limit_V=st.floats(2.0, 20.0))
def test_dahl_of_power_one_is_exponential(path: list[float], limit_V: float):
    found = duhem.respond(duhem.DAHL, np.array([limit_V, 1.0]), np.array(path))
    h, v, expected = 0.0, 0.0, []
    for target in path:
        s = np.sign(target - v)
        h = limit_V * s + (h - limit_V * s) * np.exp(-abs(target - v) / limit_V) if s else h
        v = target
        expected.append(h)
    np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize("form", HYSTERESIS.forms)
def test_hysteresis_knows_no_rate_and_opens_as_asked(form: str):
    up, down = np.linspace(0.0, 50.0, 101), np.linspace(50.0, 0.0, 101)[1:]
    cycle = np.concatenate([up, down])
    path = np.concatenate([cycle, cycle[1:], [0.0]])
    loop = as_signal(path, form)[200:401]
    opening = np.max(np.abs(loop[100::-1] - loop[100:]))
    assert opening == pytest.approx(0.2 * FULL_STROKE_UM, rel=2e-3)
    assert abs(as_signal(path, form)[200]) > 0.02 * opening
    slow = as_signal(np.repeat(path, 3), form)[::3]
    np.testing.assert_allclose(slow[:-1], as_signal(path, form)[:-1], atol=1e-9)
    jumps = as_signal(np.array([0.0, 50.0, 0.0, 30.0, 10.0]), form)
    turns = [0, 100, 200, 260, 300]
    travelled = as_signal(np.concatenate([cycle, up[1:61], up[59:19:-1]]), form)
    np.testing.assert_allclose(jumps[:4], travelled[turns[:4]], atol=1e-4)


@pytest.mark.parametrize("form", CREEP.forms)
@pytest.mark.parametrize("seed", [0, 1])
def test_creep_grows_as_asked_and_never_turns(form: str, seed: int):
    hidden = CREEP.hide(form, 0.25, CAMERA, np.random.default_rng(seed))
    times = np.concatenate([[0.0], np.geomspace(0.1, 100.0, 25)])
    grid = build_grid(times, np.empty(0), 0.0, 0.02)
    grown = grid.at_rows(after(hidden, np.ones_like(grid.nodes_s), np.zeros_like(grid.nodes_s), grid)) - 1.0
    assert grown[-1] - grown[1] == pytest.approx(0.25, rel=1e-6)
    assert np.all(np.diff(grown[1:]) > 0.0)


def test_the_stretched_exponential_is_met():
    weights = spectra.stretched(5.0, 0.6)
    t = np.geomspace(0.1, 100.0, 40)
    copied = (1.0 - np.exp(-t[:, None] / spectra.TAU_S)) @ weights
    np.testing.assert_allclose(copied, 1.0 - np.exp(-((t / 5.0) ** 0.6)), atol=4e-3)


@settings(max_examples=15)
@given(tau_s=st.floats(0.01, 50.0), seed=st.integers(0, 20))
def test_a_unit_alone_is_a_lag(tau_s: float, seed: int):
    rng = np.random.default_rng(seed)
    source, step_s = rng.normal(size=(50, 5)), rng.uniform(1e-4, 9e-4, 50)
    found = spectra.copies(source, step_s, np.array([tau_s]), np.array([1.0]))
    np.testing.assert_allclose(found, lag(source, step_s, tau_s, 0.0), atol=1e-12)
