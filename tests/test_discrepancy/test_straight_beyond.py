"""Curves of a corrected model end where the records do."""

import numpy as np
import pytest
from reported_diagnosis import levels, record_of

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.conclusion.measurement.corrected_model import straight_beyond
from bender_discrepancy.records.observations import observe
from bender_plant.model import Model, load_model
from bender_plant.valid_range import ValidRange

CURVES = {
    "output_curve": {"quadratic_1_per_um": 0.002, "quintic_1_per_um4": 1e-7},
    "lens_distortion": {"quadratic_1_per_um": 0.002, "quintic_1_per_um4": 1e-7},
    "electrostriction": {"coefficient_um_per_V2": 0.001},
}


def read(model: Model, volts: np.ndarray) -> np.ndarray:
    return Simulator(Drive.of_rows(np.arange(volts.size) / 30.0, volts, linear=False)).run(model).reading_um


@pytest.mark.parametrize("effect", CURVES)
def test_inside_nothing_changes_and_beyond_it_runs_on_along_a_line(effect: str) -> None:
    record = record_of(voltage_V=levels(30.0))
    curved = load_model("beam").with_block(effect, **CURVES[effect])
    valid = ValidRange(float(record.voltage_V.min()), float(record.voltage_V.max()), 30.0)
    straight = straight_beyond(curved, [effect], valid, [observe(record)])
    assert read(straight, record.voltage_V) == pytest.approx(read(curved, record.voltage_V), rel=1e-12, abs=1e-12)
    at = [float(read(straight, np.full(200, x * valid.highest_V))[-1]) for x in (2.0, 3.0, 4.0)]
    assert at[2] - at[1] == pytest.approx(at[1] - at[0], rel=1e-6)
    wild = [float(read(curved, np.full(200, x * valid.highest_V))[-1]) for x in (2.0, 3.0, 4.0)]
    assert wild[2] - wild[1] > 1.02 * (wild[1] - wild[0])


def test_other_blocks_stay_as_they_are() -> None:
    model = load_model("paper").with_block("output_curve", cubic_1_per_um2=1e-4)
    assert straight_beyond(model, ["source_resistance"], ValidRange(0.0, 50.0, 1.0), []) == model
