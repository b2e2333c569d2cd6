"""The model-following controller without Python gives the bits of the pure step, in both versions of FMI."""

import random
from pathlib import Path
from typing import Any

import pytest
from following_controllers import MODELS, PERIOD_S, tuned_on
from native_hosts import needs_own_compiler, own_way

from bender_cli.main import main
from bender_export.archive import unpacked
from bender_export.build import build_plant_fmu
from bender_export.following import (
    FOLLOWING_FMU,
    FOLLOWING_LOOP,
    Host,
    Tuned,
    followed_equations,
    following_settings,
)  # fmt: skip
from bender_loop.control import model_following
from bender_loop.errors import InputError
from bender_loop.fmu.check.check import check
from bender_loop.fmu.controller import FmuController
from bender_loop.fmu.file import read_description
from bender_loop.fmu.followed_model import Loop, open_follower
from bender_loop.fmu.ports import Setting
from bender_native.build import native_following_fmu
from bender_tuner.results.gains_file import write_gains

pytestmark = needs_own_compiler
LATE: dict[str, Any] = {
    "slew_V_per_s": 800.0, "horizon_ticks": 2, "lead_s": 0.001, "output": "tip_displacement",
    "parameters": {"calibration.gain": 1.05}, "held_back": 0.03, "rms_um": 0.05,
}  # fmt: skip
CASES = {2: ("late", Host(1, 0.004), LATE), 3: ("paper", Host(), {})}


def tuned_for(fmi: int, folder: Path) -> tuple[Tuned, Path, Host]:
    name, host, changes = CASES[fmi]
    model = build_plant_fmu(MODELS[name](), folder / "model.fmu")
    return tuned_on(model, **changes), model, host


@pytest.fixture(scope="module", params=CASES)
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Tuned, Path, Host, Path]:
    folder = tmp_path_factory.mktemp("native_following")
    tuned, model, host = tuned_for(request.param, folder)
    equations = followed_equations(tuned.model, model)
    controller = folder / FOLLOWING_FMU
    settings = following_settings(tuned, equations, host)
    controller.write_bytes(native_following_fmu(settings, equations, own_way(request.param)))
    return tuned, model, host, controller


def step_m(controller: FmuController, setpoint_m: float, measurement_m: float, dt_s: float) -> float:
    """One step in metres, without a way through µm."""
    given = zip((controller._setpoint, controller._measurement), (setpoint_m, measurement_m), strict=True)
    controller._instance.set_inputs([Setting(port.type, port.reference, value) for port, value in given])
    controller._instance.slave.doStep(controller._time_s, dt_s)
    controller._time_s += dt_s
    return float(controller._instance.slave.getReal([controller._command.reference])[0])


def test_it_is_the_pure_step_to_the_last_bit_and_goes_back_to_a_state(made: Any) -> None:
    tuned, model, host, fmu = made
    loop = Loop(PERIOD_S, tuned.limits, tuned.model.slew_V_per_s, host.latency_frames, (1.0,), host.command_delay_s)
    numbers = random.Random(61)
    with open_follower(tuned.model, model, tuned.gains, loop) as follower, FmuController(fmu, PERIOD_S) as controller:
        memory, slave = model_following.rest(follower), controller._instance.slave
        commands, differences, fmi3 = set[float](), [], hasattr(slave, "getFMUState")
        setpoint_m, asides = 0.0, set[float]()
        for k in range(120):
            # it rests for some samples: inside a play the controller then keeps its distance from an edge
            setpoint_m = setpoint_m if k % 6 else 1e-6 * numbers.choice((0.0, 5.0, 12.0, 30.0))
            measurement_m = 1e-6 * numbers.gauss(8.0, 4.0)
            dt_s = numbers.choice((PERIOD_S, PERIOD_S, 0.005, 0.25))
            memory = model_following.step(follower, memory, 1e6 * setpoint_m, 1e6 * measurement_m, dt_s)
            if k == 60:
                began_s, kept = controller._time_s, slave.getFMUState() if fmi3 else slave.getFMUstate()
                for _ in range(3):
                    step_m(controller, 0.0, 4e-5, PERIOD_S)
                (slave.setFMUState if fmi3 else slave.setFMUstate)(kept)
                controller._time_s = began_s
            commands.add(memory.command_V)
            asides.add(memory.aside_V)
            differences.append(step_m(controller, setpoint_m, measurement_m, dt_s) - memory.command_V)
        assert differences == [0.0] * 120
        assert len(commands) > 30
        assert host.latency_frames == 0 or len(asides) > 3


def test_it_passes_the_check_and_says_what_it_is_written_for(made: Any) -> None:
    _, _, host, fmu = made
    assert not check(fmu).faults
    values = {x.name: x for x in read_description(fmu).modelVariables}
    latency = values["sampling.latency"]
    assert float(latency.min) == float(latency.max) == float(latency.start) == host.latency_frames
    assert {"plant.c", "followed.h", "no_slopes.c"} <= {x.rpartition("/")[2] for x in unpacked(fmu)}
    with (
        pytest.raises(InputError, match=r"'inverse.horizon': found 7.0, expected at most \d$"),
        FmuController(fmu, PERIOD_S, parameters={"inverse.horizon": 7.0}),
    ):
        pass


def test_the_command_line_writes_it_and_its_loop_without_python(tmp_path: Path) -> None:
    tuned, _, _ = tuned_for(3, tmp_path)
    write_gains(tmp_path / "gains.toml", tuned.gains, tuned.limits, tuned.period_s, tuned.model)
    words = ["fmu", "controller", str(tmp_path / "gains.toml"), "--out", str(tmp_path / "out"), "--fmi", "3"]
    assert main(words) == 2
    assert main([*words, "--native", "--platforms", "none"]) == 0
    entries = unpacked(tmp_path / "out" / FOLLOWING_LOOP)
    parts = [name for name in entries if name.endswith(".fmu")]
    assert len(parts) == 3
    for data in ((tmp_path / "out" / FOLLOWING_FMU).read_bytes(), *(entries[name] for name in parts)):
        (tmp_path / "part.fmu").write_bytes(data)
        inside = unpacked(tmp_path / "part.fmu")
        assert not any(x.endswith(".py") for x in inside)
        assert b'fmiVersion="3.0"' in inside["modelDescription.xml"]
