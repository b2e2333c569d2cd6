"""What thousands of instantiations cost: nothing above PythonFMU's own."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

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
CHILD = """
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
    words = [sys.executable, "-c", CHILD, str(Path(__file__).parent), str(fmu), str(warm), str(count)]
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
