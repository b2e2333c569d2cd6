"""The FMU of the model-following controller gives the bits of the pure step with the model's own FMU."""

import math
import random
import re
import sys
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from few import few
from fmpy.fmi1 import FMICallException
from fmu_hosts import IMPORTERS, WITHIN_M, hosted, looped_in_fmpy
from following_controllers import Made
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_export.following import FOLLOWING_FMU
from bender_loop.control import model_following
from bender_loop.control.following_loop import simulate_following
from bender_loop.control.model_following import ModelFollower
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Step
from bender_loop.control.sampling import Sampling
from bender_loop.control.shaper import Shaper
from bender_loop.fmu.check.check import check
from bender_loop.fmu.followed_model import Loop, open_follower
from bender_loop.fmu.plant import FmuPlant

SAMPLES = st.lists(
    st.tuples(st.floats(-1e-5, 4e-5), st.floats(-2e-5, 5e-5), st.sampled_from([0.02, 0.005, 1 / 30, 0.25])),
    min_size=1,
    max_size=8,
)
STEPS = 40


@pytest.fixture(scope="module", params=["following_paper", "following_late"])
def made(request: pytest.FixtureRequest) -> Any:
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="module")
def controller(made: Made, running_fmu: Any) -> Iterator[Any]:
    with running_fmu(made.controller) as running:
        yield running


@pytest.fixture(scope="module")
def follower(made: Made) -> Iterator[ModelFollower]:
    """The controller as `bender hil --gains` runs it, around the FMU of the model."""
    tuned, late = made.tuned, made.tuned.model.output == "tip_displacement"
    loop = Loop(tuned.period_s, tuned.limits, math.inf, int(late), command_delay_s=0.004 if late else 0.0)
    with open_follower(tuned.model, made.model, tuned.gains, loop) as opened:
        yield opened


def begin(controller: Any, **parameters: float) -> None:
    controller.slave.reset()
    controller.messages.clear()
    controller.begin({name.replace("__", "."): value for name, value in parameters.items()})


def walk(seed: int, count: int = 40) -> list[tuple[float, float]]:
    numbers = random.Random(seed)
    return [(1e-6 * numbers.choice((0.0, 5.0, 12.0, 20.0)), 1e-6 * numbers.gauss(8.0, 4.0)) for _ in range(count)]


def run(controller: Any, samples: Sequence[tuple[float, float]], dt_s: float = 0.02) -> list[float]:
    return [controller.step(dt_s, setpoint=r, measurement=y)[0] for r, y in samples]


@settings(max_examples=10)
@given(samples=SAMPLES)
def test_it_is_the_pure_step_to_the_last_bit(controller: Any, follower: ModelFollower, samples: Any) -> None:
    begin(controller)
    memory = model_following.rest(follower)
    assert controller.get("command") == [memory.command_V]
    for setpoint_m, measurement_m, dt_s in samples:
        memory = model_following.step(follower, memory, 1e6 * setpoint_m, 1e6 * measurement_m, dt_s)
        assert controller.step(dt_s, setpoint=setpoint_m, measurement=measurement_m) == [memory.command_V]


@settings(max_examples=8)
@given(
    gains=st.builds(Gains, st.floats(0, 1), st.floats(0, 20), st.floats(0, 0.1), st.sampled_from([0.0, 0.02])),
    limits=st.builds(Limits, st.floats(-100, -1), st.floats(1, 100), st.sampled_from([0.0, 0.1])),
    bounds=st.tuples(*[st.sampled_from([0.0, 50.0, 3000.0])] * 3),
    horizon=st.integers(1, 3),
    latency=st.integers(0, 3),
    samples=SAMPLES,
)
def test_its_parameters_are_those_of_the_pure_step(
    controller: Any, follower: ModelFollower, gains: Gains, limits: Limits, bounds: tuple[float, float, float],
    horizon: int, latency: int, samples: Any,
) -> None:  # fmt: skip
    slew, rate, curvature = bounds
    begin(
        controller,
        gains__proportional=gains.proportional_V_per_um,
        gains__integral=gains.integral_V_per_um_s,
        gains__derivative=gains.derivative_V_s_per_um,
        gains__filter_time=gains.filter_time_s,
        limits__lower=limits.lower_V,
        limits__upper=limits.upper_V,
        limits__tracking_time=limits.tracking_time_s,
        limits__slew_rate=slew,
        shaper__rate=rate,
        shaper__curvature=curvature,
        inverse__horizon=horizon,
        inverse__tolerance=0.01,
        sampling__period=0.025,
        sampling__latency=latency,
        sampling__command_delay=0.0,
    )
    other = ModelFollower(
        follower.inverted, follower.predictor, gains, limits, 0.025, slew or math.inf,
        Shaper(rate or math.inf, curvature or math.inf), horizon, follower.lead_s, latency, tolerance_um=0.01,
    )  # fmt: skip
    memory = model_following.rest(other)
    for setpoint_m, measurement_m, dt_s in samples:
        memory = model_following.step(other, memory, 1e6 * setpoint_m, 1e6 * measurement_m, dt_s)
        assert controller.step(dt_s, setpoint=setpoint_m, measurement=measurement_m) == [memory.command_V]


def test_a_saved_state_goes_on_to_the_last_bit_in_another_instance_too(made: Made, controller: Any, running_fmu: Any):
    begin(controller)
    samples = walk(1)
    with running_fmu(made.controller) as other:
        for saved_after in (0, 7):
            run(controller, samples[:saved_after])
            saved = controller.saved()
            first = run(controller, samples[8:20])
            controller.restore(saved)
            assert run(controller, samples[8:20]) == first, saved_after
            run(other, samples[:3])
            other.restore(saved)
            assert run(other, samples[8:20]) == first, saved_after


def test_instances_side_by_side_are_as_each_alone(made: Made, following_paper: Made, running_fmu: Any) -> None:
    paths = (made.controller, made.controller, following_paper.controller)
    with ExitStack() as ends:
        running = [ends.enter_context(running_fmu(path)) for path in paths]
        walks = [walk(seed, 12) for seed in range(len(paths))]
        alone = [run(fmu, samples) for fmu, samples in zip(running, walks, strict=True)]
        for fmu in running:
            begin(fmu)
        together = [
            [fmu.step(0.02, setpoint=r, measurement=y)[0] for fmu, (r, y) in zip(running, tick, strict=True)]
            for tick in zip(*walks, strict=True)
        ]
    assert [list(commands) for commands in zip(*together, strict=True)] == alone


@pytest.mark.parametrize("which", few(["following_paper", "following_late"], 0))
def test_every_check_with_its_trial_run_finds_nothing(which: str, request: pytest.FixtureRequest) -> None:
    report = check(request.getfixturevalue(which).controller)
    assert report.faults == ()
    assert "trial run" in report.ran


def own_loop_um(made: Made) -> list[float]:
    """The loop of bender under the master of the tools: all components step at the same time."""
    tuned, model = made.tuned, made.tuned.model
    loop = Loop(tuned.period_s, tuned.limits, math.inf, latency_frames=1)
    sampling = Sampling(1.0 / tuned.period_s, latency_frames=1)
    neutral = {"thermal_drift.amplitude": 0.0} if model.output == "tip_displacement" else {}
    with (
        open_follower(model, made.model, tuned.gains, loop) as follower,
        FmuPlant(made.model, output_name=model.output, parameters=model.parameters | neutral) as plant,
    ):
        # the reference shows its step at the end of the first communication step, the controller takes it in the next
        setpoint = Step(10.0, 2.0 * tuned.period_s)
        trace = simulate_following(plant, follower, setpoint, sampling, STEPS * tuned.period_s)
    return trace.displacement_um[1:].tolist()


@pytest.mark.parametrize("bound", few([True, False], 0))
def test_the_loop_in_fmpy_is_that_of_bender(made: Made, bound: bool, tmp_path: Path) -> None:
    with zipfile.ZipFile(made.loop) as archive:
        values = Path(archive.extract("resources/step.ssv", tmp_path)) if bound else None
    shown_m = looped_in_fmpy(made.loop, STEPS, made.tuned.period_s, made.tuned.model.output, values)
    found = [1e6 * x for x in shown_m]
    assert found == pytest.approx(own_loop_um(made), abs=1e6 * WITHIN_M)
    assert max(found) > 5.0


@pytest.mark.parametrize("script", IMPORTERS)
def test_every_tool_runs_the_loop_of_bender(script: str, following_paper: Made, tmp_path: Path) -> None:
    (tmp_path / "unpacked").mkdir()
    with zipfile.ZipFile(following_paper.loop) as archive:
        archive.extractall(tmp_path / "unpacked")
    job: dict[str, Any] = {
        "ssp": str(following_paper.loop), "parameter_set": "step", "folder": str(tmp_path / "unpacked"),
        "controller": FOLLOWING_FMU, "start": {}, "steps": STEPS, "step_s": following_paper.tuned.period_s,
    }  # fmt: skip
    found = [1e6 * x for x in hosted(script, job, tmp_path)]
    assert found == pytest.approx(own_loop_um(following_paper), abs=1e6 * WITHIN_M)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"limits__lower": 60.0}, "60.0"),
        ({"sampling__latency": 1.5}, "sampling.latency: found 1.5, expected a whole number"),
        ({"inverse__horizon": 1.5}, "inverse.horizon: found 1.5, expected a whole number"),
        ({"sampling__command_delay": 5.0}, "delay of the command of 5.0 s"),
        ({"shaper__rate": -1.0}, "shaper.rate: found -1.0, expected 0 to"),
    ],
)
def test_values_that_cannot_be_are_errors_that_say_why(controller: Any, values: dict[str, float], message: str) -> None:
    with pytest.raises(FMICallException):
        begin(controller, **values)
    assert message in controller.messages[0]
    begin(controller)
    assert math.isfinite(controller.step(0.02, setpoint=1e-5)[0])


def test_a_set_point_that_is_no_number_is_an_error_and_leaves_the_state(controller: Any) -> None:
    begin(controller)
    before = run(controller, walk(2, 5))
    with pytest.raises(FMICallException):
        controller.set({"setpoint": math.nan})
    assert "setpoint: found nan, expected a finite number" in controller.messages[0]
    assert controller.get("command") == before[-1:]


def test_the_limits_hold_and_only_gains_and_shaper_can_be_tuned_on_the_way(controller: Any) -> None:
    begin(controller, limits__upper=7.0)
    assert max(run(controller, [(3e-5, 0.0)] * 20)) == 7.0
    controller.set({"gains.integral": 0.0, "shaper.rate": 10.0})
    with pytest.raises(FMICallException):
        controller.set({"limits.upper": 9.0})
    assert "fixed parameter" in controller.messages[0]


def test_it_carries_the_standard_library_only_and_its_page_has_every_equation(made: Made) -> None:
    with zipfile.ZipFile(made.controller) as archive:
        page = archive.read("documentation/index.html").decode()
        sources = [
            archive.read(name).decode()
            for name in archive.namelist()
            if name.endswith(".py") and not name.startswith("resources/pythonfmu/")
        ]
    assert all(title in page for title in ("Model-following control", "Shaper", "Inverse of the model", "PID block"))
    lines = [line for source in sources for line in source.splitlines() if re.match(r" *(from|import) ", line)]
    roots = {line.split()[1].partition(".")[0] for line in lines}
    others = roots - set(sys.stdlib_module_names)
    hashed = {name for name in others if re.fullmatch(r"(bender|model_following)_\w+_[0-9a-f]{12}", name)}
    assert others - hashed == {"pythonfmu"}
