"""Gain and offset of readings in coarse steps: the line that lies least beyond them."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from bender_discrepancy.conclusion.coarse_readings import NEARER, ROUNDED, support
from bender_discrepancy.fitting.fit_problem import Calibration, line_through_steps, straight_line

STEP_um = 2.9


def dwelling(seed: int, rows: int = 600) -> np.ndarray:
    """What dwells at few levels is rounded the same way for long: a straight line through that is off."""
    return np.repeat(np.random.default_rng(seed).uniform(0.0, 25.0, rows // 30), 30)


def left_beyond(line: Calibration, simulated: np.ndarray, read: np.ndarray, step_um: float) -> np.ndarray:
    left = read - line.gain * simulated - line.offsets_um[0]
    return left - np.clip(left, -step_um / 2.0, step_um / 2.0)


@settings(deadline=None, max_examples=50)
@example(seed=88, gain=0.3, offset_um=0.0, step_um=0.1)
@given(
    seed=st.integers(0, 10_000), gain=st.floats(0.3, 3.0), offset_um=st.floats(-5.0, 5.0), step_um=st.floats(0.1, 6.0)
)
def test_a_line_that_explains_every_step_is_found(seed: int, gain: float, offset_um: float, step_um: float) -> None:
    simulated = dwelling(seed)
    read = step_um * np.round((gain * simulated + offset_um) / step_um)
    line = line_through_steps([simulated], [read], [step_um / 2.0], straight_line([simulated], [read]))
    assert np.max(np.abs(left_beyond(line, simulated, read, step_um))) < 1e-3 * step_um


@pytest.mark.parametrize("seed", range(6))
def test_no_other_line_lies_less_beyond_noisy_steps(seed: int) -> None:
    simulated, rng = dwelling(seed), np.random.default_rng(seed)
    read = STEP_um * np.round((1.1 * simulated - 0.4 + 0.2 * rng.standard_normal(simulated.size)) / STEP_um)

    def square(x: np.ndarray) -> float:
        return float(np.sum(left_beyond(Calibration(x[0], (x[1],)), simulated, read, STEP_um) ** 2))

    start = straight_line([simulated], [read])
    line = line_through_steps([simulated], [read], [STEP_um / 2.0], start)
    tight = {"xatol": 1e-10, "fatol": 1e-12, "maxiter": 4000}
    least = minimize(square, [1.1, -0.4], method="Nelder-Mead", options=tight).fun
    assert square(np.array([line.gain, *line.offsets_um])) <= least * (1.0 + 1e-4) + 1e-9
    if seed == 0:
        assert square(np.array([start.gain, *start.offsets_um])) > 2.0 * least


def test_records_share_the_gain_and_have_offsets_of_their_own() -> None:
    runs = [dwelling(1), dwelling(2)]
    read = [STEP_um * np.round((1.2 * y + c) / STEP_um) for y, c in zip(runs, (0.7, -1.9), strict=True)]
    line = line_through_steps(runs, read, [STEP_um / 2.0] * 2, straight_line(runs, read))
    assert line.gain == pytest.approx(1.2, abs=0.05)
    assert line.offsets_um == pytest.approx((0.7, -1.9), abs=0.5)


def readings_left(deviation: float) -> np.ndarray:
    rng = np.random.default_rng(7)
    truth = rng.uniform(0.0, 40.0, 4000)
    return np.round(truth + deviation * rng.standard_normal(truth.size)) - truth


@pytest.mark.parametrize("deviation", [0.03, 0.1, 0.2, 0.4, 1.0, 4.0])
@pytest.mark.parametrize("limit", [NEARER, ROUNDED])
def test_readings_tell_whether_the_simulation_is_nearer_than_a_limit(deviation: float, limit: float) -> None:
    left = readings_left(deviation)
    told = float(np.sum(support(STEP_um * left, STEP_um, limit)))
    assert (told > 10.0) is (deviation < limit)
    assert (told < -10.0) is (deviation > limit)
    assert told == pytest.approx(float(np.sum(support(left, 1.0, limit))), abs=1e-6)


@pytest.mark.parametrize(("deviation", "nearer"), [(0.09, True), (0.17, False)])
def test_up_to_an_eighth_of_a_step_rounding_brings_a_simulation_nearer(deviation: float, nearer: bool) -> None:
    rng = np.random.default_rng(9)
    truth = rng.uniform(0.0, 40.0, 100_000)
    read = np.round(truth + deviation * rng.standard_normal(truth.size))
    assert (np.mean((read - np.round(truth)) ** 2) < np.mean((read - truth) ** 2)) is np.bool_(nearer)


def test_where_in_its_step_a_level_dwells_does_not_decide() -> None:
    """A simulation that dwells where the reading is in the middle of its step is as near to it rounded as not."""
    left = np.repeat(np.random.default_rng(8).uniform(-0.1, 0.1, 20), 200)
    told = support(left, 1.0, ROUNDED).reshape(20, 200).sum(axis=1)
    assert np.all(told >= 0.0)
    assert told.sum() > 20.0
