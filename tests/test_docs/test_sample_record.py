"""The sample record is what its script writes."""

from pathlib import Path

import numpy as np
from fmu_hosts import loaded

from bender_loop.records.record import read_record

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_the_sample_record_is_what_its_script_makes() -> None:
    made, shipped = loaded(EXAMPLES / "make_sample_record.py").sample_record(), read_record(EXAMPLES / "record.csv")
    assert np.array_equal(made.voltage_V, shipped.voltage_V)
    assert np.allclose(made.time_s, shipped.time_s, atol=1e-9)
    # the readings are written with four digits; another processor may round the last one otherwise
    assert np.allclose(made.displacement_um, shipped.displacement_um, atol=2e-4)
