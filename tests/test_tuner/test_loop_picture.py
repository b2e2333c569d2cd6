"""The loop over frequency: sensitivity functions against polynomials, and the picture of them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bender_loop.control.pid import UNLIMITED, Gains, PidState
from bender_loop.control.pid import step as pid_step
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.margins import UNSTABLE, margins
from bender_tuner.model.sampled_model import SampledModel
from bender_tuner.model.sensitivities import lowest_drawn_Hz, sensitivities
from bender_tuner.pictures.loop import loop_in_words

PERIOD_S, POLE, GAIN = 0.02, 0.8, 0.3
GAINS = Gains(0.4, 5.0, 0.01, 0.05)
PLANT = DelayedPlant(SampledModel(PERIOD_S, np.array([GAIN * POLE**k for k in range(300)])), 1)


def test_the_four_functions_are_those_of_a_loop_that_is_played_sample_by_sample():
    """A sine of noise at one frequency of the grid, until the loop swings in step with it."""
    found = sensitivities(GAINS, PLANT)
    row = PLANT.uniform_start + PLANT.intervals // 8 - 1
    omega = 2.0 * math.pi * found.frequency_Hz[row]
    state, x, readings, commands, sent = PidState(), 0.0, [], [], [0.0, 0.0]
    noise = np.sin(omega * PERIOD_S * np.arange(4000))
    for disturbance in noise:
        # the reading is a frame old: the plant has seen the commands up to the one before the last
        x = POLE * x + GAIN * sent[-2]
        reading = x + disturbance
        state, command = pid_step(GAINS, UNLIMITED, state, 0.0, reading, PERIOD_S)
        sent.append(command)
        readings.append(reading)
        commands.append(command)
    late = slice(2000, 4000)
    size = {name: _amplitude(np.array(values)[late], omega) for name, values in (("e", readings), ("u", commands))}
    assert size["e"] == pytest.approx(abs(found.sensitivity[row]), rel=1e-6)
    assert size["u"] == pytest.approx(abs(found.control_V_per_um[row]), rel=1e-6)


def _amplitude(values: np.ndarray, omega: float) -> float:
    phase = omega * PERIOD_S * np.arange(values.size)
    basis = np.column_stack((np.sin(phase), np.cos(phase)))
    return float(np.hypot(*np.linalg.lstsq(basis, values, rcond=None)[0]))


def test_the_functions_belong_together():
    found = sensitivities(GAINS, PLANT)
    assert found.sensitivity + found.complementary == pytest.approx(np.ones(found.loop.size))
    assert found.load_um_per_V * found.control_V_per_um == pytest.approx(found.sensitivity * found.complementary)
    assert np.max(np.abs(found.sensitivity)) == pytest.approx(margins(GAINS, PLANT).sensitivity_peak, rel=1e-3)
    # an integrator: a load at rest moves nothing, and the slow end of GS is j omega / Ki
    slow = 2.0 * math.pi * found.frequency_Hz[0] / GAINS.integral_V_per_um_s
    assert abs(found.load_um_per_V[0]) == pytest.approx(slow, rel=1e-3)


def test_what_a_picture_shows():
    assert lowest_drawn_Hz(PLANT, 2.0 * math.pi) == pytest.approx(10.0**-1.5)
    assert 0.0 < lowest_drawn_Hz(PLANT, math.nan) < 0.01 / PERIOD_S
    assert loop_in_words(UNSTABLE).startswith("the nominal loop is unstable")
    found = margins(GAINS, PLANT)
    assert "phase margin" in loop_in_words(found)
    assert "delay margin 24 ms;" in loop_in_words(replace(found, delay_margin_s=0.024))
    assert "delay margin 24.3 s;" in loop_in_words(replace(found, delay_margin_s=24.322))
