"""Whether input and reading of a record are swapped: the reading follows the input, never the other way."""

from dataclasses import replace

import numpy as np
import pytest

from bender_identify.first_model.direction import LEAST_ROWS, direction, direction_sentence
from bender_loop.records.record import Record

ROWS = 600


def lagging(command: np.ndarray, rows: float, noise: float) -> np.ndarray:
    reading = np.zeros(len(command))
    for k in range(len(command) - 1):
        reading[k + 1] = reading[k] + (command[k] - reading[k]) * (1.0 - np.exp(-1.0 / rows))
    return reading + noise * np.random.default_rng(3).normal(size=len(command))


def commands(kind: str) -> np.ndarray:
    rng, at = np.random.default_rng(2), np.arange(ROWS)
    if kind == "steps":
        return np.repeat(rng.uniform(-1.0, 1.0, ROWS // 15), 15)
    if kind == "sines":
        return np.sin(0.05 * at) + np.sin(0.31 * at + 1.0)
    return rng.normal(size=ROWS)


def record(command: np.ndarray, reading: np.ndarray) -> Record:
    return Record(0.01 * np.arange(len(command), dtype=np.float64), command, reading)


@pytest.mark.parametrize("rows", [0.5, 12.0])
@pytest.mark.parametrize("noise", [0.001, 0.02])
@pytest.mark.parametrize("kind", ["steps", "noise"])
def test_only_swapped_columns_are_asked_about(kind: str, noise: float, rows: float) -> None:
    command = commands(kind)
    reading = lagging(command, rows, noise * float(np.std(command)))
    assert direction_sentence([record(command, reading)]) == ""
    swapped = record(reading, command)
    assert "follows the reading" in direction_sentence([swapped])
    assert direction_sentence([swapped, record(command, reading)]) == ""
    assert direction_sentence([replace(swapped, setpoint_um=command)]) == ""


@pytest.mark.parametrize("swapped", [False, True])
def test_a_course_that_foretells_itself_tells_no_direction(swapped: bool) -> None:
    command = commands("sines")
    columns = (command, lagging(command, 12.0, 0.02))
    assert direction_sentence([record(*columns[:: -1 if swapped else 1])]) == ""


def test_a_controller_does_not_swap_the_columns() -> None:
    rng, goal = np.random.default_rng(4), commands("steps")
    command, reading, held, place = np.zeros(ROWS), np.zeros(ROWS), 0.0, 0.0
    for k in range(ROWS):
        reading[k] = place + 0.01 * rng.normal()
        held += 0.1 * (goal[k] - reading[k])
        command[k] = 2.0 * (goal[k] - reading[k]) + held
        place += (command[k] - place) / 10.0
    assert direction_sentence([record(command, reading)]) == ""


def test_units_and_zeros_do_not_matter_and_too_few_or_still_rows_tell_nothing() -> None:
    command = commands("steps")
    reading = lagging(command, 12.0, 0.01)
    found = direction(command, reading)
    other = direction(3.0 - 1e6 * command, 7.0 + 1e-6 * reading)
    assert found is not None
    assert other == pytest.approx(found, rel=1e-3)
    assert direction(command[: LEAST_ROWS - 1], reading[: LEAST_ROWS - 1]) is None
    assert direction(command, np.ones(ROWS)) is None
