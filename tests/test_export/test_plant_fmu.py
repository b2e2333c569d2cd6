"""The plant FMU: the numbers of the kernel, states that go on, errors that say why, thousands of instances."""

import json
import math
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException
from fmu_hosts import largest_difference
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_runs import kernel_outputs_m

from bender_export.build import build_plant_fmu
from bender_plant.blocks import BLOCKS
from bender_plant.model import Model, load_model
from bender_plant.plant import Plant

Steps = Sequence[tuple[float, float]]

STEP = [(10.0, 0.001)] * 100 + [(10.0, 0.05)] * 20
STAIRCASE = [(10.0 * (k // 20 % 6), 0.01) for k in range(240)]


EFFECTS = {
    "transport_delay.delay": 0.013,
    "slew_limit.slew_rate": 500.0,
    "charge_leakage.fraction": 0.1,
    "rate_independent_hysteresis.alpha": 0.1,
    "rate_independent_hysteresis.beta": 0.1,
    "second_mode.share": 0.1,
    "backlash.half_width": 0.3,
    "thermal_drift.amplitude": 1.0,
    "periodic_disturbance.cosine": 0.5,
    "periodic_disturbance.frequency": 7.0,
    "sensor_lag.time_constant": 0.004,
}


def model_with_every_effect() -> Model:
    model = load_model("paper")
    for block in BLOCKS.values():
        if not block.transducer:
            model = model.with_block(block.id)
    return model


@settings(max_examples=25)
@given(
    prefix=st.lists(st.tuples(st.floats(-50.0, 50.0), st.floats(1e-4, 0.2)), max_size=8),
    gain=st.sampled_from([1.0, 0.93]),
    start_s=st.sampled_from([0.0, -2.5, 1000.0]),
)
def test_a_saved_state_goes_on_to_the_last_bit(paper: Any, prefix: Steps, gain: float, start_s: float) -> None:
    def go_on() -> list[list[float]]:
        return [paper.step(step_s, voltage=voltage_V) for voltage_V, step_s in STAIRCASE[15:30]]

    paper.slave.reset()
    paper.begin({"beam.width": 0.012}, start_s)
    paper.set({"calibration.gain": gain})
    for voltage_V, step_s in prefix:
        paper.step(step_s, voltage=voltage_V)
    saved, live, time_s = paper.saved(), paper.slave.getFMUState(), paper.time_s
    first = go_on()
    paper.set({"calibration.gain": 5.0})
    paper.slave.setFMUState(live)
    paper.slave.freeFMUState(live)
    paper.time_s = time_s
    second = go_on()
    paper.slave.reset()
    paper.begin({})
    paper.restore(saved)
    paper.time_s = time_s
    assert first == second == go_on()


def test_halving_the_communication_step_changes_nothing_to_speak_of(plant: Any) -> None:
    whole = [plant.step(0.01, voltage=voltage_V) for voltage_V, _ in STAIRCASE]
    plant.slave.reset()
    plant.begin({})
    halves = [[plant.step(0.005, voltage=voltage_V) for _ in range(2)][1] for voltage_V, _ in STAIRCASE]
    assert largest_difference(whole, halves) <= 1e-9


def test_reset_returns_to_rest_and_to_the_start_values(plant: Any) -> None:
    first = [plant.step(0.01, voltage=20.0) for _ in range(5)]
    plant.set({"calibration.offset": 3.0})
    plant.slave.reset()
    plant.begin({})
    assert plant.get("displacement", "tip_displacement", "calibration.offset", "voltage") == [0.0] * 4
    assert [plant.step(0.01, voltage=20.0) for _ in range(5)] == first


@pytest.fixture(scope="module")
def effects_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_plant_fmu(model_with_every_effect(), tmp_path_factory.mktemp("fmu") / "effects.fmu")


@pytest.mark.slow
@pytest.mark.parametrize("start_s", [0.0, 5.03])
def test_every_effect_runs_with_its_phase(effects_fmu: Path, running_fmu: Any, start_s: float) -> None:
    steps = STAIRCASE[15:65]
    with running_fmu(effects_fmu, EFFECTS, start_s) as running:
        found = [running.step(step_s, voltage=voltage_V) for voltage_V, step_s in steps]
    expected = kernel_outputs_m(model_with_every_effect().with_values(EFFECTS), steps, start_s)
    assert largest_difference(found, expected) <= 1e-12


def test_the_first_reading_has_the_disturbance_in_it(effects_fmu: Path, running_fmu: Any) -> None:
    wave = {"periodic_disturbance.sine": 0.5, "periodic_disturbance.frequency": 1.0}
    with running_fmu(effects_fmu, wave, start_s=0.25) as running:
        assert running.get("displacement") == [pytest.approx(5e-7, abs=1e-12)]


@pytest.mark.parametrize("start_s", [5.0, -1.0])
def test_a_start_time_other_than_zero_starts_at_rest(plant: Any, start_s: float) -> None:
    from_zero = [plant.step(0.01, voltage=20.0) for _ in range(5)]
    plant.slave.reset()
    plant.begin({}, start_s)
    assert plant.get("displacement") == [0.0]
    shifted = [plant.step(0.01, voltage=20.0) for _ in range(5)]
    assert largest_difference(shifted, from_zero) <= 1e-12


def test_the_first_reading_has_the_calibration_in_it(plant: Any) -> None:
    plant.slave.reset()
    plant.set({"calibration.offset": 2.0})
    assert plant.get("displacement", "tip_displacement") == [2e-6, 0.0]
    plant.begin({})
    assert plant.get("displacement", "tip_displacement") == [2e-6, 0.0]


def test_parameters_set_before_initialisation_are_those_of_the_model(plant: Any) -> None:
    values = {"beam.length": 0.02, "bending_modes.damping_ratio": 0.1}
    plant.slave.reset()
    plant.begin(values)
    outputs = [plant.step(step_s, voltage=voltage_V) for voltage_V, step_s in STEP]
    assert plant.get(*values) == list(values.values())
    expected = kernel_outputs_m(load_model("paper").with_values(values), STEP)
    assert largest_difference(outputs, expected) <= 1e-12


def test_a_tunable_parameter_acts_from_the_next_step_on(plant: Any) -> None:
    model = load_model("paper")
    before, after = Plant(model), Plant(model.with_values({"calibration.gain": 2.0}))
    state, reading_um, _ = before.step(before.initial(), 10.0, 0.0, 0.01)
    assert plant.step(0.01, voltage=10.0)[0] == pytest.approx(1e-6 * reading_um, abs=1e-15)
    plant.set({"calibration.gain": 2.0})
    _, reading_um, _ = after.step(state, 10.0, 0.01, 0.01)
    assert plant.step(0.01)[0] == pytest.approx(1e-6 * reading_um, abs=1e-15)


def test_the_slave_needs_an_interpreter_and_nothing_else(effects_fmu: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(effects_fmu) as archive:
        archive.extractall(tmp_path)
    code = """
import importlib, pathlib, sys
sys.path.insert(0, sys.argv[1])
slave = importlib.import_module(pathlib.Path(sys.argv[1], "slavemodule.txt").read_text())
plant = slave.PiezoBender(instance_name="alone", resources=sys.argv[1])
plant.setup_experiment(0.0, None, None)
plant.exit_initialization_mode()
plant.set_real([0], [10.0])
print(plant.do_step(0.0, 0.01), plant.get_real([1])[0] > 0.0)
"""
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code, str(tmp_path / "resources")],
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert done.stdout == "True True\n", done.stderr


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"voltage": math.nan}, ["voltage", "nan", "finite"]),
        ({"voltage": math.inf}, ["voltage", "inf", "finite"]),
        ({"bending_modes.damping_ratio": 2.0}, ["bending_modes.damping_ratio", "2.0", "1e-06 to 0.95"]),
        ({"bending_modes.damping_ratio": math.nan}, ["bending_modes.damping_ratio", "nan", "1e-06 to 0.95"]),
        ({"beam.length": 0.01}, ["beam.length", "before the end of initialisation"]),
        ({"displacement": 0.0}, ["displacement", "cannot be set"]),
    ],
)
def test_a_value_that_cannot_be_is_an_error_that_says_why(
    plant: Any, values: dict[str, float], words: list[str]
) -> None:
    plant.step(0.01, voltage=10.0)
    with pytest.raises(FMICallException):
        plant.set(values)
    (message,) = plant.messages
    for word in words:
        assert word in message
    assert math.isfinite(plant.step(0.01)[0])


@pytest.mark.parametrize("step_s", [0.0, -0.01, math.nan, math.inf])
def test_a_step_that_cannot_be_is_an_error(plant: Any, step_s: float) -> None:
    with pytest.raises(FMICallException):
        plant.slave.doStep(0.0, step_s)
    assert repr(step_s) in plant.messages[0]


def test_a_plant_that_runs_away_is_an_error_that_says_when(plant: Any) -> None:
    plant.set({"learned_hysteresis.rate_coefficient": 1e4})
    with pytest.raises(FMICallException):
        plant.step(0.01, voltage=1e305)
    assert "t = 0.0 s" in plant.messages[0]
    assert plant.get("displacement") == [0.0]


def test_a_state_of_another_fmu_is_refused(plant: Any, beam_fmu: Path, running_fmu: Any) -> None:
    with running_fmu(beam_fmu) as beam:
        foreign = beam.saved()
    for data in (foreign, b"[1, 2", b"[]"):
        with pytest.raises(FMICallException):
            plant.restore(data)
    assert "state of another FMU" in plant.messages[0]


def test_errors_leave_the_instance_whole(plant_fmu: Path) -> None:
    """PythonFMU's library drops references that it still needs when a call raises."""
    code = """
import gc, math, sys
sys.path.insert(0, sys.argv[1])
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from running_fmu import RunningFmu
fmu = RunningFmu(sys.argv[2])
(slave,) = [thing for thing in gc.get_objects() if type(thing).__name__ == "PiezoBender"]
held = (slave, type(slave), slave.log_queue)
before = [sys.getrefcount(thing) for thing in held]
for _ in range(20):
    try:
        fmu.set({"voltage": math.nan})
    except FMICallException:
        continue
    raise SystemExit("no error")
print([sys.getrefcount(thing) for thing in held] == before)
"""
    here = str(Path(__file__).parent)
    done = subprocess.run(
        [sys.executable, "-c", code, here, str(plant_fmu)], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.stdout == "True\n", done.stderr


CHILD = """
import sys
from pathlib import Path
from bender_export.build import build_plant_fmu, ensure_plant_fmu
from bender_loop.fmu.plant import FmuPlant
from bender_plant.model import load_model

folder = Path(sys.argv[1])
first = build_plant_fmu(load_model("paper"), folder / "first.fmu")
with FmuPlant(first) as plant:
    before = plant.step(10.0, 0.01)
again = build_plant_fmu(load_model("paper"), folder / "again.fmu")
assert again.read_bytes() == first.read_bytes()
second = build_plant_fmu(load_model("paper").with_values({"calibration.gain": 2.0}), folder / "second.fmu")
with FmuPlant(second) as plant:
    assert abs(plant.step(10.0, 0.01) - 2.0 * before) < 1e-9
ensure_plant_fmu("paper")
print("built")
"""


@pytest.mark.slow
def test_fmus_can_be_built_after_one_was_opened(tmp_path: Path) -> None:
    words = [sys.executable, "-W", "error", "-c", CHILD, str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "built"


# The library of PythonFMU leaks some kilobytes with each instance: the same slave with an empty body is the yardstick.
BARE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class BareOfTheInstanceTest(Fmi2Slave):
    def __init__(self, **settings):
        super().__init__(**settings)
        self.u = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))

    def do_step(self, current_time, step_size):
        return True
"""
MANY = """
import gc, json, resource, sys
sys.path.insert(0, sys.argv[1])
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from running_fmu import RunningFmu

def use(slave, count):
    for _ in range(count):
        slave.instantiate()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        slave.doStep(0.0, 0.01)
        slave.terminate()
        slave.fmi2FreeInstance(slave.component)

def resident_kB():
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * resource.getpagesize() / 1024

path, warm, count = sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
description = read_model_description(path, validate=False)
slave = FMU2Slave(
    guid=description.guid, unzipDirectory=extract(path),
    modelIdentifier=description.coSimulation.modelIdentifier, instanceName="many",
)
use(slave, warm)
gc.collect()
objects, before = len(gc.get_objects()), resident_kB()
use(slave, count)
gc.collect()
paths = sum("resources" in entry for entry in sys.path)
print(json.dumps({"objects": len(gc.get_objects()) - objects, "kB": resident_kB() - before, "paths": paths}))
"""


def growth(fmu: Path, warm: int, count: int) -> dict[str, float]:
    words = [sys.executable, "-c", MANY, str(Path(__file__).parent), str(fmu), str(warm), str(count)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=250)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def bare_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bare_fmu")
    (folder / "bare_of_the_instance_test.py").write_text(BARE, encoding="utf-8")
    code = "import sys; from pythonfmu.builder import FmuBuilder; FmuBuilder.build_FMU(sys.argv[1], dest=sys.argv[2])"
    words = [sys.executable, "-c", code, str(folder / "bare_of_the_instance_test.py"), str(folder)]
    subprocess.run(words, check=True, cwd=folder)
    return folder / "BareOfTheInstanceTest.fmu"


@pytest.mark.skipif(sys.platform != "linux", reason="reads the memory in use from /proc")
@pytest.mark.slow
def test_5000_instantiations_grow_no_more_than_those_of_a_bare_slave(plant_fmu: Path, bare_fmu: Path) -> None:
    own, bare = growth(plant_fmu, 200, 5000), growth(bare_fmu, 200, 5000)
    print(own, bare)
    assert own["objects"] <= bare["objects"]
    assert own["kB"] <= bare["kB"]
    assert own["paths"] == 1
