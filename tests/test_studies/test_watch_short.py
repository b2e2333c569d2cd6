"""Short records of devices with memory: no alarm of what came before them, and every change in the middle found."""

import numpy as np
import pytest

from bender_studies.watching import short
from bender_studies.watching.short import BEGINS, CHANGES, NOISE_um, Short, devices, recorded, table_of_short, watched


def test_a_few_records_of_a_device_raise_no_false_alarm(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(short, "devices", lambda: {"eq. (30)": devices()["eq. (30)"]})
    found = list(watched(6, 1e6, 77, lambda _: None))
    assert [x.begins for x in found] == [*BEGINS] * 6
    assert not any(x.false for x in found)
    assert all(x.delay is not None and 0 < x.delay < 100 for x in found if x.change != CHANGES[0])
    columns, rows = table_of_short(found)
    assert [len(x) for x in rows] == [len(columns)] * 2
    assert rows[0][:3] == ["eq. (30)", "in motion", 6]
    assert rows[0][5] == 0


def test_a_change_begins_in_the_middle_and_readings_are_as_on_a_bench() -> None:
    model = devices()["creep"]
    calm, late = (recorded(model, BEGINS[1], x, 2000, 5) for x in (CHANGES[0], CHANGES[2]))
    assert np.array_equal(calm.displacement_um[:1000], late.displacement_um[:1000], equal_nan=True)
    assert not np.array_equal(calm.displacement_um[1000:], late.displacement_um[1000:], equal_nan=True)
    assert np.isnan(calm.displacement_um).any()
    steps = calm.displacement_um / NOISE_um
    assert np.nanmax(np.abs(steps - np.round(steps))) < 1e-6
    assert not calm.voltage_V[:2].any()


def test_a_change_that_nothing_found_is_never_found() -> None:
    _, (row,) = table_of_short([Short("a", "b", CHANGES[1], 10, 5, False, None)])
    assert row == ["a", "b", 1, 10, 5, 0, "0 of 1", "never", "0 of 0", "never"]
