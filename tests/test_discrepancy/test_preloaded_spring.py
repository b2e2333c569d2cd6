"""Springs that are not a pure cubic about rest, integrated by an oracle that shares no code with the plant."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bender_discrepancy.workflow import search_records
from bender_loop.records.record import Record
from bender_plant.blocks import bending_modes, linear_transduction
from bender_plant.model import BlockSettings, Model

FREQUENCY_HZ, ZETA, CUBIC, REST_um, NOISE_um = 2.0, 0.05, 2e-4, 6.0, 0.02
STEP_S, ROWS = 0.04, 1500
QUICK_HZ, QUINTIC = 41.0, 6e-9


def record(
    preload_um: float = 0.0,
    cubic: float = CUBIC,
    quintic: float = 0.0,
    frequency_Hz: float = FREQUENCY_HZ,
    seed: int = 4,
) -> Record:
    """Levels of chance of either sign, and what x'' + 2 zeta omega x' + omega^2 (F(x) - u) = 0 answers."""
    rng = np.random.default_rng(seed)
    volts = np.repeat(rng.uniform(-20.0, 20.0, ROWS), rng.integers(5, 60, ROWS))[:ROWS]
    volts[0] = 0.0
    omega = 2.0 * np.pi * frequency_Hz

    def rate(_: float, x: np.ndarray, u: float) -> list[float]:
        force = cubic * ((x[0] + preload_um) ** 3 - preload_um**3 - 3.0 * preload_um**2 * x[0]) + quintic * x[0] ** 5
        return [x[1], omega * omega * (u - x[0] - force) - 2.0 * ZETA * omega * x[1]]

    state, shown = np.zeros(2), [0.0]
    for u in volts[:-1].tolist():
        state = solve_ivp(rate, (0.0, STEP_S), state, args=(u,), rtol=1e-9, atol=1e-9).y[:, -1]
        shown.append(float(state[0]))
    reading = np.array(shown) + NOISE_um * rng.standard_normal(ROWS)
    return Record(STEP_S * np.arange(ROWS, dtype=np.float64), volts, reading)


def oscillator(frequency_Hz: float = FREQUENCY_HZ) -> Model:
    modes = bending_modes.Parameters(first_frequency_Hz=frequency_Hz, damping_ratio=ZETA)
    linear = linear_transduction.Parameters(sensitivity_um_per_V=1.0)
    blocks = BlockSettings(linear_transduction.ID, linear), BlockSettings(bending_modes.ID, modes)
    return Model("oscillator", None, blocks)


@pytest.mark.slow
@pytest.mark.parametrize("preload_um", [0.0, REST_um], ids=["symmetric", "preloaded"])
def test_a_cubic_spring_is_named_alone_wherever_it_is_symmetric(preload_um: float) -> None:
    found = search_records(oscillator(), [record(preload_um)])
    assert (found.verdict.word, found.best.hypothesis.effects) == ("named", ("stiffening",))
    assert found.verdict.complete
    values = found.best.hypothesis.values()
    assert values[0] == pytest.approx(CUBIC, rel=0.02)
    assert values[1:] == (pytest.approx((preload_um,), rel=0.05) if preload_um else ())


@pytest.mark.slow
@pytest.mark.parametrize("cubic", [-1e-4, pytest.param(CUBIC, marks=pytest.mark.slow)])
def test_a_spring_with_a_part_of_the_fifth_degree_is_one_effect(cubic: float) -> None:
    """It rings more than once between two rows: springs of either sign are valleys of the misfit."""
    found = search_records(oscillator(QUICK_HZ), [record(cubic=cubic, quintic=QUINTIC, frequency_Hz=QUICK_HZ)])
    assert (found.verdict.word, found.best.hypothesis.effects) == ("named", ("stiffening",))
    assert found.verdict.complete
    assert found.best.hypothesis.values()[0] == pytest.approx(cubic, rel=0.02)
    assert found.best.hypothesis.values()[1] == pytest.approx(-QUINTIC / cubic, rel=0.2)
