"""Linear candidates of other devices: dead time, a spring that stiffens, a reading without sign, long records."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import TransferFunction, lsim

from bender_identify.first_model.choice import first_model
from bender_identify.first_model.excerpt import MOST_ROWS, excerpts
from bender_identify.first_model.linear_structures import linear_structures
from bender_identify.first_model.structures import Structure
from bender_identify.records.experiment import experiment_of
from bender_identify.settings import Settings
from bender_loop.records.record import Record

ROW_S = 0.02


def levels(rows: int, seed: int, hold: int = 12) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(-3.0, 3.0, rows), hold)[:rows]


def lagging(volts: np.ndarray, tau_s: float, step_s: float = ROW_S) -> np.ndarray:
    """A first-order lag of held inputs, read at the end of each row before the next input acts."""
    decay, y, read = math.exp(-step_s / tau_s), 0.0, []
    for u in volts:
        read.append(y)
        y = decay * y + (1.0 - decay) * u
    return np.array(read)


def record_of(volts: np.ndarray, read: np.ndarray, noise: float, step_s: float = ROW_S) -> Record:
    rng = np.random.default_rng(11)
    return Record(step_s * np.arange(volts.size, dtype=np.float64), volts, read + rng.normal(0.0, noise, read.size))


def test_candidates_come_best_first_and_the_first_one_is_the_device():
    volts = levels(500, 3)
    late = np.concatenate([np.zeros(4), lagging(volts, 0.3)])[: volts.size]
    found = linear_structures(record_of(volts, 2.0 * late + 5.0, 0.02))
    assert found[0].structure == Structure(lags=1, delay=True)
    values = found[0].model.values()
    assert values["plant_lag.time_constant"] == pytest.approx(0.3, rel=0.03)
    assert values["transport_delay.delay"] == pytest.approx(4 * ROW_S, abs=0.3 * ROW_S)
    others = [x.unseen_rms for x in found[1:]]
    assert others == sorted(others)
    assert found[-1].structure == Structure()
    assert all(len(x.losses) == len(found[0].losses) for x in found)


@pytest.mark.slow
def test_dead_time_is_found_in_a_record_that_starts_in_motion():
    # the first rows belong to inputs that no row shows
    volts = 5.0 + levels(460, 5)
    late = np.concatenate([np.full(9, 5.0), lagging(volts, 0.2)])[: volts.size]
    late[:9] = 4.0
    found = linear_structures(record_of(volts[60:], late[60:], 0.02))
    assert found[0].structure.delay
    assert found[0].model.values()["transport_delay.delay"] == pytest.approx(9 * ROW_S, abs=0.5 * ROW_S)


@pytest.mark.slow
def test_a_spring_that_stiffens_is_likelier_than_a_second_mode():
    rng, step_s, omega = np.random.default_rng(2), 0.01, 2.0 * math.pi * 4.0
    volts = np.repeat(rng.uniform(-1.0, 1.0, 120), 5)
    read, state = [], np.zeros(2)
    for u in volts:
        read.append(state[0])

        def rates(_: float, s: np.ndarray, u: float = u) -> list[float]:
            return [s[1], -2 * 0.05 * omega * s[1] - omega**2 * (s[0] + 0.8 * s[0] ** 3 - u)]

        state = solve_ivp(rates, (0.0, step_s), state, rtol=1e-7, atol=1e-9).y[:, -1]
    record = record_of(volts, np.array(read), 0.01, step_s)
    found = first_model([experiment_of(record, "duffing", Settings())])
    assert found.rival is not None
    assert found.rival.effect == "stiffening"
    assert found.chosen.structure == Structure(modes=1)
    assert found.rival.part["cubic_1_per_um2"] > 0.0


@pytest.mark.slow
def test_a_reading_without_sign_hides_its_lag_and_is_no_reason_to_refuse():
    volts = np.where(levels(500, 8, 20) > 0.0, 1.5, -1.5)
    read = np.abs(lagging(volts, 0.25))
    experiment = experiment_of(record_of(volts, read, 0.01), "counter", Settings(), any_answer=True)
    found = first_model([experiment])
    assert found.rival is not None
    assert found.rival.effect == "fold"
    hidden = [x for x in linear_structures(record_of(volts, read, 0.01)) if x.hidden_behind]
    assert [x.hidden_behind for x in hidden] == ["fold"]
    assert hidden[0].model.values()["plant_lag.time_constant"] == pytest.approx(0.25, rel=0.1)


@pytest.mark.parametrize("hold", ["hold", "linear"])
def test_excerpts_are_short_and_keep_what_the_rows_show(hold):
    rows = 30_000
    time_s = 1e-3 * np.arange(rows, dtype=np.float64)
    volts = np.sin(2.0 * math.pi * 0.7 * time_s) * np.exp(-((time_s - 20.0) ** 2) / 20.0)
    read = lsim(TransferFunction([1.0], [0.05, 1.0]), volts, time_s)[1]
    whole = experiment_of(Record(time_s, volts, read), "long", Settings(), hold)
    parts = excerpts([whole])
    assert sum(x.time_s.size for x in parts) <= 1.1 * MOST_ROWS
    assert all(np.all(np.diff(x.time_s) > 0.0) for x in parts)
    # most of the excerpt lies where it moves
    counted = np.concatenate([x.measured_um[x.fitted | x.held_out] for x in parts])
    assert np.std(counted) > 0.99 * np.std(read)
    assert excerpts([parts[0]]) == [parts[0]]


def test_two_equal_lags_are_no_mode_at_its_largest_damping():
    rng = np.random.default_rng(8)
    volts = np.concatenate([[0.0], levels(799, 8)])
    time_s = 0.05 * np.arange(volts.size, dtype=np.float64)
    read = lsim(TransferFunction([1.0], [0.09, 0.6, 1.0]), volts, time_s, interp=False)[1]
    found = linear_structures(record_of(volts, read + 0.01 * rng.standard_normal(read.size), 0.05))
    of_order_two = [x for x in found if x.structure.order == 2 and not x.structure.delay]
    assert {x.structure.name: x.rings for x in of_order_two} == {"gain+lag+lag": True, "gain+mode": False}
