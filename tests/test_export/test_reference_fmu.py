"""The FMU of the setpoint: one step, stairs up and down, whatever the host's idea of adding up times."""

from collections.abc import Iterator
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException

from bender_export.build import reference_fmu


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
