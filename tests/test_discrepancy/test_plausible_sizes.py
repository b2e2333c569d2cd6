"""Readings that no plausible gain brings near the model are refused; one that holds a voltage is not."""

import numpy as np
import pytest

from bender_discrepancy.records.checks import read_model, refuse_unusable
from bender_discrepancy.settings import Settings
from bender_loop.errors import InputError
from bender_loop.records.record import Record

ROWS = 1800


def record(factor: float) -> Record:
    """A camera record of one step in its second row, and of what creeps by a tenth of it afterwards."""
    volts = np.full(ROWS, 14.0)
    volts[:2] = 0.0
    time_s = np.arange(ROWS) / 30.0
    read = factor * (0.4 * volts + 1.5 * time_s / 30.0 + np.random.default_rng(1).normal(0.0, 0.05, ROWS))
    return Record(time_s, volts, read)


def test_a_record_that_holds_a_voltage_is_measured_by_how_far_its_step_goes():
    refuse_unusable(read_model("paper"), ["one"], [record(1.0)], Settings())


def test_a_thousand_times_more_is_refused():
    with pytest.raises(InputError, match="say what units"):
        refuse_unusable(read_model("paper"), ["one"], [record(10_000.0)], Settings())
