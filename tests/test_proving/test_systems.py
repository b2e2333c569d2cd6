"""Drawn linear systems: their answers against an integrator of scipy, their draws."""

import numpy as np
import pytest
from bender_proving.systems.linear import LinearSystem, drawn_system
from bender_proving.systems.played import ROW_S, played_system
from scipy.integrate import solve_ivp


@pytest.mark.parametrize("delay_s", [0.0, 0.013, 0.25])
def test_the_answer_is_that_of_an_integrator(delay_s: float):
    system = LinearSystem(0.7, (0.1, 0.03), ((2.0, 0.05, 0.8), (7.0, 0.03, 0.2)), delay_s)
    time_s = np.arange(60, dtype=np.float64) * 0.02
    volts = np.random.default_rng(1).uniform(0.0, 10.0, 60)
    A, B, C = system.matrices()
    state, read, begin = np.zeros(system.order), [0.0], 0.0
    edges = np.unique(np.concatenate([time_s, time_s + delay_s]))
    for end in edges[1:]:
        held = np.searchsorted(time_s + delay_s, begin + 1e-9, side="right") - 1
        u = volts[held] if held >= 0 else 0.0
        run = solve_ivp(lambda t, x, u=u: A @ x + B * u, (begin, end), state, rtol=1e-11, atol=1e-12)
        state, begin = run.y[:, -1], end
        if np.isclose(time_s, end, atol=1e-9).any():
            read.append(float(C @ state))
    assert system.answer(time_s, volts) == pytest.approx(np.array(read[:60]), abs=1e-7)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_draws_have_their_order_and_unit_shares(order: int):
    for seed in range(20):
        system = drawn_system(order, np.random.default_rng(seed))
        assert system.order == order
        assert system.modes == () or sum(share for *_, share in system.modes) == pytest.approx(1.0)
        A, B, C = system.matrices()
        assert -C @ np.linalg.solve(A, B) == pytest.approx(system.gain)
        assert np.linalg.eigvals(A).real.max() < 0.0


def test_an_order_that_is_not_drawn_is_refused():
    with pytest.raises(ValueError, match="found 5, expected 1 to 4"):
        drawn_system(5, np.random.default_rng(0))


def test_the_same_seed_plays_the_same():
    a, b = played_system(3, 7), played_system(3, 7)
    assert np.array_equal(a.reading_um[0], b.reading_um[0])
    assert not np.array_equal(a.voltage_V[0], a.voltage_V[1])
    assert a.time_s[1] - a.time_s[0] == pytest.approx(ROW_S)
