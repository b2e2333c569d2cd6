import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_loop.records.record import Record
from bender_loop.records.replay import RESTING_UM, replay


class Lag:
    """gain / (tau s + 1), stepped exactly."""

    def __init__(self, gain: float = 0.5, tau_s: float = 0.3) -> None:
        self.gain, self.tau_s, self.y = gain, tau_s, 0.0

    def reset(self) -> None:
        self.y = 0.0

    def step(self, voltage_V: float, step_s: float) -> float:
        target = self.gain * voltage_V
        self.y = target + (self.y - target) * math.exp(-step_s / self.tau_s)
        return self.y

    def close(self) -> None: ...


def _record(time_s: np.ndarray, voltage_V: np.ndarray, displacement_um: np.ndarray) -> Record:
    return Record(time_s, voltage_V, displacement_um)


def _steady_sine(plant: Lag, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A sine around 5 V and the lag's answer to it long after it began, in closed form."""
    omega = 2 * np.pi
    phase = math.atan(omega * plant.tau_s)
    return 5 + 3 * np.sin(omega * time_s), plant.gain * (5 + 3 * math.cos(phase) * np.sin(omega * time_s - phase))


def test_record_from_rest_is_replayed_from_rest():
    plant, time_s = Lag(), np.arange(200) / 50
    voltage_V = np.where(time_s < 1, 0.0, 10.0)
    truth = np.where(time_s <= 1, 0.0, plant.gain * 10 * (1 - np.exp(-(time_s - 1) / plant.tau_s)))
    result = replay(plant, _record(time_s, voltage_V, truth))
    assert result.start == "rest"
    assert result.simulated_um == pytest.approx(truth, abs=1e-9)


@given(st.floats(-1e3, 1e3), st.floats(0.1, 30))
def test_record_that_starts_in_motion_is_met_from_its_first_row(offset_um, gain):
    plant, time_s = Lag(), np.arange(800) / 200
    voltage_V, truth = _steady_sine(plant, time_s)
    result = replay(plant, _record(time_s, voltage_V, gain * truth + offset_um), input_hold="linear")
    assert result.start == "motion"
    assert result.simulated_um == pytest.approx(truth, abs=0.01)


def test_step_from_rest_at_the_first_row_needs_no_lead_in():
    plant, time_s = Lag(), np.arange(200) / 50
    truth = plant.gain * 10 * (1 - np.exp(-time_s / plant.tau_s))
    result = replay(plant, _record(time_s, np.full(200, 10.0), truth))
    assert result.start == "rest"
    assert result.acting_V[:2].tolist() == [0.0, 10.0]


def test_acting_voltage_is_that_of_the_row_before_when_held_and_of_the_row_when_straight():
    plant, time_s = Lag(), np.arange(4) / 10
    record = _record(time_s, np.array([0.0, 0.0, 2.0, 3.0]), np.zeros(4))
    assert replay(plant, record).acting_V.tolist() == [0.0, 0.0, 0.0, 2.0]
    assert replay(plant, record, input_hold="linear").acting_V.tolist() == [0.0, 0.0, 2.0, 3.0]


@given(st.lists(st.floats(-50, 50), min_size=3, max_size=20), st.floats(1e-6, 1e6))
def test_untimed_rows_are_settled_pairs_whatever_the_times_say(voltages, scale):
    plant, voltage_V = Lag(), np.array(voltages)
    record = _record(scale * np.arange(1, voltage_V.size + 1), voltage_V, np.zeros_like(voltage_V))
    result = replay(plant, record, untimed=True)
    assert result.simulated_um == pytest.approx(plant.gain * voltage_V, abs=RESTING_UM)
    assert result.acting_V.tolist() == voltages


def test_lost_frames_do_not_decide_how_the_record_starts():
    plant, time_s = Lag(), np.arange(800) / 200
    voltage_V, truth = _steady_sine(plant, time_s)
    lost = truth.copy()
    lost[[0, 5, 700]] = np.nan
    result = replay(plant, _record(time_s, voltage_V, lost), input_hold="linear")
    assert result.start == "motion"


def test_untimed_rows_wait_for_a_slow_plant():
    plant = Lag(tau_s=4.0)
    voltage_V = np.array([1.0, 50.0, -50.0])
    result = replay(plant, _record(np.arange(3.0), voltage_V, np.zeros(3)), untimed=True)
    assert result.simulated_um == pytest.approx(plant.gain * voltage_V, abs=RESTING_UM)
