"""What a simulation expects of gains: the cost of a loop, and none for one that the bench would end."""

import json
import math
from hashlib import sha256

import numpy as np
import pytest

from bender_investigate.bench_port import Controller
from bender_investigate.proof import Task, cost_of
from bender_investigate.retuning import GAINS, Retuned, retune, tune_settings, tuned, would_be_ended
from bender_investigate.safety import Allowed
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.trace import Trace
from bender_native.ready import ready_plant_fmu
from bender_proving import make_case
from bender_studies.investigations.virtual_bench import VirtualBench
from bender_tuner.results.gains_file import read_controller

TRAVEL_UM = (-10.0, 45.0)
LIMITS = Limits(0.0, 50.0)
TASK = Task(10.0, 4.0, 2.0)
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
    sentence = Retuned(Controller(Gains(0.1, 1.0, 0.0, 0.0)), math.inf, 2.5).sentence
    assert sentence.endswith("goes from a loop that swings until the bench ends it to 2.5 µm s²")


@pytest.fixture(scope="module")
def retuned(tmp_path_factory):
    """New gains of a bench that is as its diagnosis says, and the folder that they are in."""
    folder = tmp_path_factory.mktemp("diagnosis")
    fmu = folder / "model.fmu"
    fmu.write_bytes(ready_plant_fmu("paper").read_bytes())
    digest = sha256(fmu.read_bytes()).hexdigest()
    told = {
        "model": "model.toml", "fmu": fmu.name, "unit": "um", "input_unit": "V", "sha256": {fmu.name: digest},
        "gap": {"after": {"rms": 0.05, "nrmse_percent": 0.3}},
        "smallest_visible": {"transport_delay": {"parameter": "delay_s", "value": 0.002}},
    }  # fmt: skip
    (folder / "diagnosis.json").write_text(json.dumps(told))
    settings = tune_settings(ALLOWED, TASK, 0.06, 0.0, 31, 1)
    return retune(fmu, tuned(fmu, settings), settings, TASK, TRAVEL_UM, folder), folder


def test_new_gains_follow_the_model_that_they_are_tuned_on(retuned):
    found, folder = retuned
    gains, _, _, model = read_controller(folder / GAINS)
    assert (gains, model) == (found.controller.gains, found.controller.model)
    assert model is not None
    assert "as the diagnosis of the model has it" in found.following_note
    assert found.new_cost < 0.8 * found.old_cost
    assert found.sentence.endswith("with a controller that follows it")


def test_the_bench_plays_the_controller_that_follows(retuned):
    """The old gains are the same, without the model: what is saved is what following it is worth."""
    found, _ = retuned
    bench = VirtualBench(make_case("nothing", (), 3, "camera"))
    costs = []
    for controller in (Controller(found.controller.gains), found.controller):
        record, trip = bench.looped(TASK.reference, controller, TASK.duration_s, None)
        assert trip is None
        costs.append(cost_of(record, TASK))
    assert costs[1] < 0.8 * costs[0]
