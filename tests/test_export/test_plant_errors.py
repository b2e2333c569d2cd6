import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException


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
