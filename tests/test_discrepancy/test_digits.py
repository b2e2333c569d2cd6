"""The digits of a record that mean something: a conversion of units there and back must leave no trace."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from bender_discrepancy.records.digits import DIGITS, printed
from bender_loop.records.record import Record
from piezo_bender import load_record

SAMPLE = Path(__file__).parents[2] / "examples" / "record.csv"

FACTORS = (1e3, 1e-3, 1e6, 1.0 / 60.0, 1.0 / 25_400.0)


@given(st.integers(0, 2**32 - 1), st.sampled_from(FACTORS), st.floats(-3.0, 3.0))
@examples(max_examples=60)
def test_a_conversion_there_and_back_leaves_the_same_bits(seed: int, factor: float, size: float) -> None:
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.uniform(0.01, 0.05, 200))
    volts, reading = rng.uniform(0.0, 50.0, 200) * 10.0**size, rng.standard_normal(200)
    reading[7] = np.nan
    own = Record(time_s, volts, reading)
    there, back = factor, 1.0 / factor
    converted = Record(time_s * there * back, volts * there * back, reading * there * back)
    one, other = printed(own), printed(converted)
    different = 0
    for name, values in one.columns().items():
        different += int(np.sum(~np.isclose(values, other.columns()[name], rtol=0.0, atol=0.0, equal_nan=True)))
        assert np.nanmax(np.abs(values - own.columns()[name])) <= 10.0 ** (1 - DIGITS) * np.nanmax(np.abs(values))
    assert np.max(np.abs(np.diff(one.time_s) - np.diff(time_s))) < 1e-8 * 0.05
    # a value within 1e-16 of the middle of two decimals, of 600
    assert different <= 1


@pytest.mark.parametrize("values", [[0.0, 0.1, 0.25], [2.5, 2.5, 2.5], [1e9, 1e9 + 1e-6, 1e9 + 2e-6], [0.0, 0.0, 0.0]])
def test_digits_that_were_written_stay_as_they_are(values: list[float]) -> None:
    record = Record(np.arange(3.0), np.array(values), np.array([1.0, np.nan, 2.0]))
    assert np.array_equal(printed(record).voltage_V, record.voltage_V)
    assert np.array_equal(printed(record).displacement_um, record.displacement_um, equal_nan=True)


@pytest.mark.parametrize("gap_s", [1e12, 1e6, 0.0])
def test_rows_beside_a_long_gap_keep_their_distances(gap_s: float) -> None:
    time_s = np.concatenate([np.arange(50.0) / 3.0, gap_s + 100.0 + np.arange(50.0) / 3.0])
    record = Record(time_s, np.ones(100), np.arange(100.0))
    assert np.diff(printed(record).time_s) == pytest.approx(np.diff(time_s), abs=1e-8)


@pytest.mark.parametrize("units", ["ms,mV,nm", "us,kV,mm", "min,uV,m"])
def test_a_record_in_other_units_is_searched_as_the_same_numbers(units: str) -> None:
    """What is searched is the same to the last bit but for ties, so the verdict and its numbers are."""
    known = {"ms": 1e3, "us": 1e6, "min": 1 / 60, "mV": 1e3, "kV": 1e-3, "uV": 1e6, "nm": 1e3, "mm": 1e-3, "m": 1e-6}
    per = [known[unit] for unit in units.split(",")]
    own = load_record(SAMPLE).record
    columns = {
        name: factor * getattr(own, name)
        for name, factor in zip(("time_s", "voltage_V", "displacement_um"), per, strict=True)
    }
    read = load_record(columns, units=units).record
    for name in columns:
        one, other = getattr(printed(own), name), getattr(printed(read), name)
        assert np.mean(~np.isclose(one, other, rtol=0.0, atol=0.0, equal_nan=True)) <= 0.002
        assert np.allclose(one, other, rtol=1e-9, atol=1e-9 * float(np.nanmax(np.abs(one))), equal_nan=True)
