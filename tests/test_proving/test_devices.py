"""Devices drawn at random: the same again from a seed, within what a table can hold, and true to their elements."""

import csv
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_proving.devices.device import RIGHT_NAMES, Device
from bender_proving.devices.record import Habits, Strange, draw

PLAIN = Habits("steps", 200, 0.02, 10.0, 0.0, 0.0, 0.0, 0, 0.0, 0, 1.0, 0.0, 1.0, 0.0, 0.0)
HALF = (0.5,) * 6


def _rows(strange: Strange, folder: Path, number: int = 0) -> np.ndarray:
    path = folder / f"{strange.seed}-{number}.csv"
    strange.write(path, number)
    with path.open(newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head == ["time_s", "voltage_V", "displacement_um"]
    return np.array([[float(x) if x else math.nan for x in row] for row in rows]).T


def test_a_seed_gives_the_same_device_and_another_record_at_each_number(tmp_path: Path):
    assert draw(5) == draw(5)
    first, again, second = (_rows(draw(5), tmp_path, k) for k in (0, 0, 1))
    assert np.array_equal(first, again, equal_nan=True)
    assert not np.array_equal(first[1][:50], second[1][:50])


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6))
def test_a_record_is_a_table_with_time_that_rises(seed: int, tmp_path_factory: pytest.TempPathFactory):
    time_s, command, reading = _rows(draw(seed), tmp_path_factory.mktemp("records"))
    assert np.all(np.diff(time_s) > 0.0)
    assert np.all(np.isfinite(command))
    assert np.count_nonzero(np.isfinite(reading)) > 0.5 * len(reading)


def test_every_kind_and_every_habit_is_drawn():
    drawn = [draw(seed) for seed in range(600)]
    kinds = Counter(kind for x in drawn for kind in x.device.kinds)
    assert set(kinds) == set(RIGHT_NAMES)
    assert any(not x.device.kinds for x in drawn)
    for name in ("gaps", "lost", "outliers", "jump", "offset", "gain_of_loop", "jitter"):
        assert 0.02 < np.mean([getattr(x.habits, name) != 0.0 for x in drawn]) < 0.98, name


def test_a_gain_reads_its_command(tmp_path: Path):
    # a row is read before its own command acts, so a plain gain shows the one before
    _, command, reading = _rows(Strange(1, Device((), -2.0, (), 0.1), PLAIN), tmp_path)
    assert reading[1:] == pytest.approx(-2.0 * command[:-1])


@pytest.mark.parametrize("kind", ["lag", "mode", "delay", "play", "stops"])
def test_what_is_still_for_long_is_reached(kind: str, tmp_path: Path):
    habits = replace(PLAIN, play="one step", rows=500)
    _, command, reading = _rows(Strange(1, Device((kind,), 1.0, (HALF,), 0.05), habits), tmp_path)
    assert abs(reading[-1] - command[-1]) < 0.1 * 10.0
    assert abs(reading[51] - command[51]) > 0.01


def test_names_are_right_for_what_is_in_a_device_alone():
    device = Device(("lag",), 1.0, (HALF,), 0.1)
    assert "sensor_lag" in device.right_names
    assert "offset" in device.right_names
    assert "thermal_drift" not in device.right_names


@pytest.mark.parametrize(("place", "is_two_lags"), [(0.85, False), (0.95, True)])
def test_a_mode_that_is_damped_beyond_one_is_two_lags(place: float, is_two_lags: bool) -> None:
    device = Device(("mode",), 1.0, ((0.3, place, 0.0, 0.0, 0.0, 0.0),), 0.1)
    assert ("sensor_lag" in device.right_names) is is_two_lags
    (mode,) = device.elements(1.0)
    dt_s, omega, damping = 1e-4, 2.0 / 0.05, 10.0 ** (-1.7 + 1.9 * place)
    answer = np.array([mode(1.0, dt_s) for _ in range(4000)])
    if is_two_lags:
        slow, fast = (1.0 / (omega * (damping + sign * math.sqrt(damping**2 - 1.0))) for sign in (-1.0, 1.0))
        time_s = dt_s * np.arange(1, 4001)
        lags = 1.0 - (slow * np.exp(-time_s / slow) - fast * np.exp(-time_s / fast)) / (slow - fast)
        assert np.max(np.abs(answer - lags)) < 0.01
    else:
        assert np.max(answer) > 1.0
