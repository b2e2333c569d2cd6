"""Columns that the records lack and that would tell apart what they leave open."""

import numpy as np
import pytest

from bender_discrepancy.witnesses.would_tell import would_tell
from bender_loop.records.record import Record

ROWS = np.arange(50.0)
PLAIN = Record(ROWS, ROWS, ROWS)
READ_BACK = Record(ROWS, ROWS, ROWS, supply_voltage_V=ROWS)
WARM = Record(ROWS, ROWS, ROWS, temperature_C=ROWS)


def columns(*effects, records=(PLAIN,)):
    return {x.column: x.shows for x in would_tell(map(frozenset, effects), records)}


def test_a_lag_of_the_source_against_one_of_the_sensor_is_told_by_what_the_supply_reads_back():
    (found,) = would_tell([frozenset({"source_resistance", "creep"}), frozenset({"sensor_lag", "creep"})], [PLAIN])
    assert found.to_dict() == {
        "column": "supply_voltage_V",
        "shows": ["source_resistance"],
        "why": "what the supply reads back beside each row (column supply_voltage_V) would show source resistance "
        "before the terminals",
    }


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


@pytest.mark.parametrize(("records", "left"), [((READ_BACK,), set()), ((READ_BACK, PLAIN), {"supply_voltage_V"})])
def test_a_column_that_every_record_has_is_not_asked_for(records, left):
    assert set(columns({"slew_limit"}, {"sensor_lag"}, records=records)) == left


def test_a_temperature_that_was_recorded_is_not_asked_for():
    assert not columns({"thermal_drift"}, {"ageing"}, records=(WARM,))
