"""Columns that the records lack and that could distinguish what they leave open."""

from dataclasses import replace

import numpy as np
import pytest

from bender_discrepancy.witnesses.missing_columns import missing_columns
from bender_loop.records.record import Record

ROWS = np.arange(120) / 30.0
VOLTS = np.repeat([0.0, 10.0, 30.0, 5.0], 30)
PLAIN = Record(ROWS, VOLTS, VOLTS)
READ_BACK = replace(PLAIN, supply_voltage_V=VOLTS)
PROBED = replace(PLAIN, electrode_voltage_V=VOLTS)
WARM = replace(PLAIN, temperature_C=20.0 + ROWS)
FEW = np.where(np.arange(120) < 10, VOLTS, np.nan)


def columns(*effects, records=(PLAIN,), is_film=True):
    return {x.column: x.tells for x in missing_columns(map(frozenset, effects), records, is_film=is_film)}


def test_where_the_supply_was_read_back_the_electrodes_are_asked_for_alone():
    sets = ({"source_resistance"}, {"sensor_lag"})
    assert set(columns(*sets, records=(READ_BACK,))) == {"electrode_voltage_V"}
    assert not columns(*sets, records=(PROBED,))
    assert not columns({"slew_limit"}, {"sensor_lag"}, records=(PROBED,))


def test_what_all_leaders_have_is_in_question_nowhere():
    assert not columns({"source_resistance", "creep"}, {"source_resistance", "charge_leakage"})
    assert not columns({"source_resistance"})
    assert not columns({"creep"}, {"charge_leakage"})


def test_two_effects_of_the_supply_are_told_apart_as_well():
    assert columns({"slew_limit"}, {"supply_fall_lag"}) == {"supply_voltage_V": ("slew_limit", "supply_fall_lag")}


def test_a_drift_is_told_by_the_temperature_and_both_columns_are_named_where_both_tell():
    assert columns({"thermal_drift"}, {"creep"}) == {"temperature_C": ("thermal_drift",)}
    both = columns({"thermal_drift", "slew_limit"}, {"creep", "sensor_lag"})
    assert both == {"supply_voltage_V": ("slew_limit",), "temperature_C": ("thermal_drift",)}


@pytest.mark.parametrize(("records", "left"), [((READ_BACK,), set()), ((READ_BACK, PLAIN), set())])
def test_what_one_record_of_a_bench_has_read_back_is_not_asked_for(records, left):
    assert set(columns({"slew_limit"}, {"sensor_lag"}, records=records)) == left


@pytest.mark.parametrize("read_V", [FEW, np.full(120, np.nan)], ids=["few", "none"])
def test_a_column_that_says_nothing_is_asked_for(read_V):
    empty = replace(PLAIN, supply_voltage_V=read_V, temperature_C=read_V)
    assert set(columns({"slew_limit"}, {"sensor_lag"}, records=(empty,))) == {"supply_voltage_V"}
    assert set(columns({"thermal_drift"}, {"ageing"}, records=(empty,))) == {"temperature_C"}


def test_a_temperature_is_heard_only_where_every_record_has_it():
    assert not columns({"thermal_drift"}, {"ageing"}, records=(WARM,))
    assert set(columns({"thermal_drift"}, {"ageing"}, records=(WARM, PLAIN))) == {"temperature_C"}
