"""Events in words: in the units of the record, and no size that nobody knows."""

from typing import Any

import pytest

from bender_watch.words import sentence

SIZE = {"rms_um": 0.4, "std_um": 0.05, "grows": False, "shape": "step"}
ALARM: dict[str, Any] = {
    "event": "alarm", "number": 1, "time_s": 2.0, "suspects": [], "size": SIZE,
    "since": {"time_s": 1.0, "time_low_s": 0.9, "time_high_s": 1.1},
}  # fmt: skip


@pytest.mark.parametrize(("units", "told"), [({}, "0.4 ± 0.05 µm"), ({"units": ["in", "kip"]}, "0.4 ± 0.05 kip")])
def test_a_size_comes_in_the_unit_of_the_readings(units: dict[str, Any], told: str) -> None:
    assert told in sentence(ALARM | units)


@pytest.mark.parametrize("std", [None, 0.3])
def test_a_size_that_nobody_knows_is_not_told(std: float | None) -> None:
    assert "size not known yet" in sentence(ALARM | {"size": SIZE | {"std_um": std}})


def test_a_command_outside_the_training_range_comes_in_its_unit() -> None:
    event = {"event": "outside_training_range", "time_s": 2.0, "voltage_V": 0.6, "range_V": [-0.1, 0.5]}
    assert "0.6 in, trained -0.1 to 0.5 in" in sentence(event | {"units": ["in", "kip"]})
    assert "0.6 V" in sentence(event)
