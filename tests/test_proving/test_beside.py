"""Instruments beside the sensor of a hidden bench: they show what is there, with errors of their own, and no more."""

from few import few
from dataclasses import replace

import numpy as np
import pytest

from bender_proving import Bench, make_case
from bender_proving.cases.case import Case
from bender_proving.records.beside import COLUMNS

LAGS = ("source_resistance", "sensor_lag")


def _read(case: Case, column: str, number: int = 10) -> tuple[np.ndarray, np.ndarray]:
    """The commanded voltage and what the instrument shows, shapes (n,)."""
    bench = Bench(case)
    plan = bench.excitation()
    record = bench.with_columns(bench.record(plan, bench.noise(number), number), plan, (column,), number)
    shown = getattr(record, column)
    assert shown is not None
    assert shown.shape == record.voltage_V.shape
    return record.voltage_V, shown


def _off(commanded_V: np.ndarray, shown_V: np.ndarray) -> np.ndarray:
    """How far a reading lies outside what the supply was told before and in its row."""
    earlier = np.concatenate([[0.0], commanded_V[:-1]])
    return np.maximum(np.minimum(commanded_V, earlier) - shown_V, shown_V - np.maximum(commanded_V, earlier))


def _lags(case: Case, column: str) -> bool:
    error_V = 0.05 + 0.005 * 50.0 + 5.0 * 0.02 + 0.01
    return bool(np.max(_off(*_read(case, column))[1:]) > error_V)


@pytest.mark.parametrize("name", few(LAGS, 0))
@pytest.mark.parametrize("moved", [0.0, 0.2])
def test_the_electrodes_show_what_lags_before_them_alone(name: str, moved: float) -> None:
    case = make_case("moved" if moved else "single", (name,), 7, "camera", moved=moved)
    assert _lags(case, "electrode_voltage_V") == (name == "source_resistance")


@pytest.mark.slow
def test_the_terminals_show_a_lag_of_the_supply_and_none_of_the_leads() -> None:
    cases = [make_case("single", (name,), seed, "camera") for name in LAGS for seed in range(8)]
    shown = [_lags(x, "supply_voltage_V") for x in cases]
    assert 0 < sum(shown[:8]) < 8
    assert not any(shown[8:])


def test_a_moved_form_moves_what_the_supply_puts_out_by_the_same_part() -> None:
    case = make_case("moved", ("source_resistance",), 7, "camera", moved=0.2)
    commanded_V, moved_V = _read(case, "electrode_voltage_V")
    _, plain_V = _read(replace(case, moved=0.0), "electrode_voltage_V")
    fitted = np.column_stack([plain_V, commanded_V, np.ones_like(plain_V)])
    of_lag_V = plain_V - fitted[:, 1:] @ np.linalg.lstsq(fitted[:, 1:], plain_V, rcond=None)[0]
    part = np.std(moved_V - plain_V) / np.std(of_lag_V)
    assert 0.1 < part < 0.3


@pytest.mark.parametrize(("name", "warms"), [("thermal_drift", True), ("creep", False)])
def test_the_thermometer_shows_what_drifts_with_the_warmth_alone(name: str, warms: bool) -> None:
    _, shown_C = _read(make_case("single", (name,), 7, "camera"), "temperature_C")
    tenth = len(shown_C) // 10
    change_K = abs(np.mean(shown_C[-tenth:]) - np.mean(shown_C[:tenth]))
    assert (change_K > 0.01) == warms


@pytest.mark.parametrize("column", few(COLUMNS, 0))
def test_a_bench_keeps_its_instruments_and_draws_their_noise_anew(column: str) -> None:
    case = make_case("single", ("creep",), 3, "camera")
    (_, first), (_, again), (_, other) = (_read(case, column, number) for number in (10, 10, 11))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert abs(np.mean(first - other)) < 0.01  # gain and offset are those of the bench


def test_there_is_no_instrument_for_every_column() -> None:
    bench = Bench(make_case("nothing", (), 1, "camera"))
    plan = bench.excitation()
    with pytest.raises(KeyError, match="humidity"):
        bench.with_columns(bench.record(plan, bench.noise()), plan, ("humidity",))
