"""A relaxation that bends, fitted to runs of an FMU, which an oracle integrates that shares no code with it."""

import numpy as np
import pytest
from few import few
from scipy.integrate import solve_ivp

from bender_discrepancy.foreign.relaxation_model import fit_relaxation
from bender_loop.records.record import Record
from bender_plant.blocks import bending_modes, learned_hysteresis
from bender_plant.model import BlockSettings, Model

FREQUENCY_HZ, ZETA = 12.0, 0.05


def run(coefficients: tuple[float, ...], step_s: float, rest: float, rows: int = 400) -> tuple[Record, np.ndarray]:
    """Return levels of chance and what z' = a w + b u + d |w| + e w |w|, w = z + c u, and a mode behind it show."""
    a, b, c, d, e = coefficients
    rng = np.random.default_rng(5)
    volts = np.repeat(rng.uniform(0.0, 30.0, rows), rng.integers(1, 60, rows))[:rows]
    volts[0] = 0.0
    times = step_s * np.arange(rows, dtype=np.float64)
    omega = 2.0 * np.pi * FREQUENCY_HZ
    state, shown = np.zeros(3), [0.0]

    def rate(_: float, x: np.ndarray, u: float) -> list[float]:
        w = x[0] + c * u
        slow = a * w + b * u + d * abs(w) + e * w * abs(w)
        return [slow, x[2], omega * omega * (w - x[1]) - 2.0 * ZETA * omega * x[2]]

    for u in volts[:-1].tolist():
        state = solve_ivp(rate, (0.0, step_s), state, args=(u,), rtol=1e-9, atol=1e-9).y[:, -1]
        shown.append(float(state[1]))
    return Record(times, volts, np.zeros(rows)), np.array(shown) + rest


def guess() -> tuple[BlockSettings, ...]:
    """Return the blocks of a linear model whose mode is not quite that of the runs."""
    return (BlockSettings(bending_modes.ID, bending_modes.Parameters(first_frequency_Hz=11.0, damping_ratio=0.1)),)


def coefficients_of(model: Model) -> tuple[float, ...]:
    found = next(x.parameters for x in model.blocks if x.id == learned_hysteresis.ID)
    return learned_hysteresis.constants(found, None)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("coefficients", few([(-0.5, 1.6, 0.8, -0.2, -0.12), (-2.0, 3.0, -0.3, 0.0, -0.05)], 0))
def test_an_equation_is_found_again_from_runs_at_several_rates(coefficients: tuple[float, ...]) -> None:
    runs = [run(coefficients, 0.05, 3.0), run(coefficients, 0.005, 3.0)]
    found = fit_relaxation(runs, guess(), "hold")
    assert found is not None
    (a, b, c, d, e), (true_a, *others, true_d, true_e) = coefficients_of(found), coefficients
    # w hardly falls below 0 here: w and |w| act together
    assert (a + d, b, c, e) == pytest.approx((true_a + true_d, *others, true_e), rel=1e-3, abs=1e-3)
    modes = next(x.parameters for x in found.blocks if x.id == bending_modes.ID)
    assert isinstance(modes, bending_modes.Parameters)
    assert modes.first_frequency_Hz == pytest.approx(FREQUENCY_HZ, rel=1e-3)
    assert modes.damping_ratio == pytest.approx(ZETA, rel=1e-2)


def test_a_relaxation_without_a_mode_gets_none() -> None:
    rows = 300
    rng = np.random.default_rng(2)
    volts = np.repeat(rng.uniform(0.0, 30.0, rows), 20)[:rows]
    volts[0] = 0.0
    shown, w = [0.0], 0.0
    for u in volts[:-1].tolist():
        for _ in range(200):
            middle = w + 0.5 * 2.5e-4 * (1.5 * u - w - 0.1 * w * w)
            w += 2.5e-4 * (1.5 * u - middle - 0.1 * middle * middle)
        shown.append(w)
    record = Record(0.05 * np.arange(rows, dtype=np.float64), volts, np.zeros(rows))
    found = fit_relaxation([(record, np.array(shown))], guess(), "hold")
    assert found is not None
    assert bending_modes.ID not in {x.id for x in found.blocks}
    a, b, c, d, e = coefficients_of(found)
    # w never falls below 0 here: w and |w| act together
    assert (a + d, b, c, e) == pytest.approx((-1.0, 1.5, 0.0, -0.1), abs=2e-3)
