"""What a simulation expects of gains: the cost of a loop, and none for one that the bench would end."""

import math

import numpy as np
import pytest

from bender_investigate.proof import Task
from bender_investigate.retuning import Retuned, tune_settings, would_be_ended
from bender_investigate.safety import Allowed
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.trace import Trace

TRAVEL_UM = (-10.0, 45.0)
LIMITS = Limits(0.0, 50.0)
ALLOWED = Allowed(0.0, 50.0, 250.0, 0.1, TRAVEL_UM, 30.0)


def trace(tip_um):
    count = len(tip_um)
    time_s = np.arange(count) / 30.0
    return Trace(time_s, np.full(count, 10.0), tip_um, tip_um, np.full(count, 20.0), False, time_s, tip_um)


@pytest.mark.parametrize(("swing_um", "ended"), [(1.0, False), (2.0, True)])
def test_a_loop_that_swings_by_more_than_a_twentieth_of_the_travel_would_be_ended(swing_um, ended):
    tip_um = 10.0 + swing_um * (-1.0) ** np.arange(40)
    assert would_be_ended(trace(tip_um), LIMITS, TRAVEL_UM) is ended


def test_a_tip_beyond_the_travel_would_be_ended():
    still = np.full(40, 10.0)
    assert not would_be_ended(trace(still), LIMITS, TRAVEL_UM)
    assert would_be_ended(trace(np.where(np.arange(40) == 20, 46.0, still)), LIMITS, TRAVEL_UM)


@pytest.mark.parametrize(("exposure_s", "tuned_s"), [(0.0, 0.0), (0.0001, 0.0), (0.004, 0.004), (0.03, 0.015)])
def test_the_loop_is_tuned_with_the_exposure_of_the_records(exposure_s, tuned_s):
    settings = tune_settings(ALLOWED, Task(10.0, 4.0, 3.0), 0.06, exposure_s, 10, 1)
    assert settings.exposure_s == pytest.approx(tuned_s)


def test_a_loop_that_would_be_ended_is_said_in_words():
    sentence = Retuned(Gains(0.1, 1.0, 0.0, 0.0), math.inf, 2.5).sentence
    assert sentence.endswith("goes from a loop that swings until the bench ends it to 2.5 µm s²")
