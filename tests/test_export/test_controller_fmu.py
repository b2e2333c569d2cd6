"""The FMUs of the controller and of the set point: the bits of the PID block, stairs whatever the host's clock."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_export.build import reference_fmu
from bender_loop.control.pid import Gains, Limits, PidState, step

SIGNAL_m = st.floats(-1e-4, 1e-4)


@pytest.fixture(scope="module")
def controller(controller_fmu: Path, running_fmu: Any) -> Iterator[Any]:
    with running_fmu(controller_fmu) as running:
        yield running


def begin(controller: Any, gains: Gains, limits: Limits) -> None:
    controller.slave.reset()
    controller.messages.clear()
    controller.begin(
        {
            "gains.proportional": gains.proportional_V_per_um,
            "gains.integral": gains.integral_V_per_um_s,
            "gains.derivative": gains.derivative_V_s_per_um,
            "gains.filter_time": gains.filter_time_s,
            "gains.derivative_on_error": gains.derivative_on_error,
            "limits.lower": limits.lower_V,
            "limits.upper": limits.upper_V,
            "limits.tracking_time": limits.tracking_time_s,
        }
    )


@settings(max_examples=25)
@given(
    gains=st.builds(
        Gains, st.floats(0, 10), st.floats(0, 100), st.floats(0, 1), st.sampled_from([0.0, 0.02]), st.booleans()
    ),
    limits=st.builds(Limits, st.floats(-100, -1), st.floats(1, 100), st.sampled_from([0.0, 0.1])),
    samples=st.lists(st.tuples(SIGNAL_m, SIGNAL_m, st.sampled_from([0.01, 0.004, 1 / 30])), min_size=1, max_size=10),
)
def test_it_is_the_pid_block_to_the_last_bit(
    controller: Any, gains: Gains, limits: Limits, samples: list[tuple[float, float, float]]
) -> None:
    begin(controller, gains, limits)
    state = PidState()
    for setpoint_m, measurement_m, dt_s in samples:
        state, command_V = step(gains, limits, state, 1e6 * setpoint_m, 1e6 * measurement_m, dt_s)
        assert controller.step(dt_s, setpoint=setpoint_m, measurement=measurement_m) == [command_V]


def test_a_saved_state_goes_on_to_the_last_bit(controller: Any) -> None:
    begin(controller, Gains(0.5, 5.0, 0.01, 0.02), Limits(0.0, 20.0, 0.1))
    controller.set({"setpoint": 1e-5})
    for saved_after in range(3):
        saved = controller.saved()
        first = [controller.step(0.01, measurement=1e-6 * k) for k in range(5)]
        controller.restore(saved)
        assert [controller.step(0.01, measurement=1e-6 * k) for k in range(5)] == first, saved_after


def test_before_the_first_sample_the_command_is_the_nearest_to_zero(controller: Any) -> None:
    begin(controller, Gains(1.0, 0.0), Limits(5.0, 50.0))
    assert controller.get("command") == [5.0]


def test_limits_that_cross_are_an_error_at_the_end_of_initialisation(controller: Any) -> None:
    controller.slave.reset()
    controller.messages.clear()
    with pytest.raises(FMICallException):
        controller.begin({"limits.lower": 60.0})
    assert "60.0" in controller.messages[0]
    controller.slave.reset()
    controller.begin({"limits.lower": 60.0, "limits.upper": 70.0})
    assert controller.get("command") == [60.0]


@pytest.mark.parametrize("values", [{"setpoint": math.nan}, {"gains.integral": -1.0}, {"gains.integral": math.nan}])
def test_a_value_that_cannot_be_is_an_error_that_says_why(controller: Any, values: dict[str, float]) -> None:
    begin(controller, Gains(1.0, 0.0), Limits())
    with pytest.raises(FMICallException):
        controller.set(values)
    ((name, value),) = values.items()
    assert f"{name}: found {value!r}, expected" in controller.messages[0]


def test_a_command_beyond_all_numbers_is_an_error_and_leaves_the_state(controller: Any) -> None:
    begin(controller, Gains(0.0, 5.0), Limits())
    before = controller.step(0.01, setpoint=1e-5)
    with pytest.raises(FMICallException):
        controller.step(0.01, setpoint=-1.7e308)
    assert "found a command of nan V" in controller.messages[0]
    assert controller.get("command") == before
    controller.set({"setpoint": 1e-5})
    assert math.isfinite(controller.step(0.01)[0])


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory, running_fmu: Any) -> Iterator[Any]:
    path = tmp_path_factory.mktemp("reference") / "reference.fmu"
    path.write_bytes(reference_fmu())
    with running_fmu(path) as running:
        yield running


def setpoints(reference: Any, steps: int, start_s: float = 0.0, **values: float) -> list[float]:
    reference.slave.reset()
    reference.messages.clear()
    reference.begin({f"staircase.{name}": value for name, value in values.items()}, start_s)
    return [reference.get("setpoint")[0]] + [reference.step(0.1)[0] for _ in range(steps)]


def test_one_step(reference: Any) -> None:
    assert setpoints(reference, 3) == [0.0, 1e-5, 1e-5, 1e-5]
    assert setpoints(reference, 3, start=0.2, initial=1e-6) == [1e-6, 1e-6, 1e-6, 1e-5]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_stairs(reference: Any, sign: float) -> None:
    found = setpoints(reference, 9, final=sign * 5e-6, rise=2e-6, dwell=0.3)
    expected = [0.0] + [sign * 2e-6] * 3 + [sign * 4e-6] * 3 + [sign * 5e-6] * 3
    assert found == pytest.approx(expected, abs=1e-18)


def test_times_that_are_off_by_rounding_change_nothing(reference: Any) -> None:
    exact = setpoints(reference, 30, rise=1e-6, dwell=0.3)
    reference.slave.reset()
    reference.begin({"staircase.rise": 1e-6, "staircase.dwell": 0.3})
    found = [reference.get("setpoint")[0]]
    for k in range(30):
        reference.time_s = k * 0.1
        found += reference.step(0.1)
    assert found == exact


def test_a_later_start_of_the_run_is_a_later_place_on_the_stairs(reference: Any) -> None:
    assert setpoints(reference, 2, start_s=0.35, rise=2e-6, dwell=0.3) == pytest.approx([4e-6] * 3, abs=1e-18)


@pytest.mark.parametrize(("values", "words"), [({"dwell": 0.0}, "staircase.dwell"), ({"rise": -1.0}, "staircase.rise")])
def test_values_that_cannot_be_are_refused(reference: Any, values: dict[str, float], words: str) -> None:
    with pytest.raises(FMICallException):
        setpoints(reference, 1, **values)
    assert words in reference.messages[0]
