"""Benches with instruments beside the sensor: the meters show what is there, each with errors of its own."""

import numpy as np
import pytest

from bender_proving.cases.hidden import Hidden
from bender_proving.cases.witnessed import SITUATIONS, witnessed_case
from bender_proving.chain import Commands, terminals_V
from bender_proving.records.meters import Ammeter, Thermometer, Voltmeter, drawn_voltmeter

NAMES = tuple(f"{x.effect}-{x.shown_by or x.cleared_by}" for x in SITUATIONS)


def _commanded(voltage_V: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least and the most that terminals which follow have in each row."""
    earlier = np.concatenate([[0.0], voltage_V[:-1]])
    return np.minimum(voltage_V, earlier), np.maximum(voltage_V, earlier)


@pytest.mark.parametrize("number", range(len(NAMES)), ids=NAMES)
def test_the_instruments_show_what_they_can_and_nothing_else(number: int) -> None:
    case = witnessed_case(number, 3)
    record = case.record
    assert record.temperature_C is not None
    tenth = len(record) // 10
    warmed_K = abs(np.mean(record.temperature_C[-tenth:]) - np.mean(record.temperature_C[:tenth]))
    assert (warmed_K > 0.01) == (case.shown_by == "thermometer")
    assert (record.current_A is not None) == (case.shown_by == "ammeter")
    if record.supply_voltage_V is None:
        assert case.shown_by == "ammeter"
        return
    low, high = _commanded(record.voltage_V)
    # gain, offset, noise and resolution of the meter
    error_V = 0.06 + 0.005 * record.voltage_V.max() + 5.0 * 0.02 + 0.01
    off = np.maximum(low - record.supply_voltage_V, record.supply_voltage_V - high)
    assert (np.max(off[1:]) > error_V) == (case.shown_by == "voltmeter")


def test_the_same_number_and_seed_give_the_same_bench() -> None:
    first, again, other = witnessed_case(1, 5), witnessed_case(1, 5), witnessed_case(1, 6)
    assert first.hidden == again.hidden
    assert np.array_equal(first.record.displacement_um, again.record.displacement_um)
    assert first.hidden != other.hidden


def test_the_terminals_of_a_supply_that_slews_climb_in_a_straight_line() -> None:
    rows_s = np.arange(10) / 10.0
    commands = Commands(rows_s, rows_s, np.where(rows_s >= 0.1, 5.0, 0.0))
    slow = Hidden("slew_limit", "hard", 10.0, (("rate_V_per_s", 10.0), ("landing_s", 0.0)))
    at_s = np.array([0.05, 0.1, 0.2, 0.35, 0.6, 0.9])
    assert terminals_V(commands, (slow,), at_s) == pytest.approx([0.0, 0.0, 1.0, 2.5, 5.0, 5.0])
    assert terminals_V(commands, (), at_s) == pytest.approx([0.0, 5.0, 5.0, 5.0, 5.0, 5.0])


@pytest.mark.parametrize("seed", range(5))
def test_a_voltmeter_is_read_within_each_row(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.uniform(0.5, 1.5, 200))
    at_s = drawn_voltmeter(rng).instants_s(time_s, rng)
    assert np.all(at_s >= time_s)
    assert np.all(at_s[:-1] <= time_s[1:])


def test_meters_have_errors_of_their_own() -> None:
    rng = np.random.default_rng(1)
    shown = Voltmeter(1.01, 0.1, 0.0, 0.01, 0.5, 0.0).shown_V(np.array([0.0, 10.0]), rng)
    assert shown == pytest.approx([0.1, 10.2])
    drawn_A = Ammeter(1e-6, 1e9, 1e-6, 0.0, 1e-9, 0.001).shown_A(np.array([0.0, 5.0]), np.array([0.01, 5.0]), rng)
    assert drawn_A == pytest.approx([11e-6, 1.005e-6], abs=1e-9)
    time_s = np.linspace(0.0, 10.0, 1001)
    late = Thermometer(0.0, 1e-6, 1.0, 20.0).shown_C(time_s, np.minimum(time_s, 1.0), rng)
    assert late[100] == pytest.approx(20.0 + np.exp(-1.0), abs=1e-3)
    assert late[-1] == pytest.approx(21.0, abs=1e-3)
