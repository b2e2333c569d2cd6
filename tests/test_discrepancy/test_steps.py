"""Steps of the supply and of the sensor: how finely they are found, and where readings never stand still."""

import numpy as np
import pytest
from told_diagnosis import NOISE_um, record_of

from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.fitting.fit_problem import problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import training_residual
from bender_discrepancy.fitting.special_starts import scan_any
from bender_discrepancy.records.observations import observe
from bender_discrepancy.workflow import candidate_forms, search_records
from bender_loop.records.record import Record
from bender_plant.model import load_model

PAPER = load_model("paper")


@pytest.mark.parametrize("step_V", [0.8977, 1.731])
def test_no_step_of_the_supply_nearby_is_better(step_V: float):
    """Commands between the levels, at every row another: the misfit falls in jumps, and a slope finds nothing."""
    volts = np.random.default_rng(4).uniform(0.0, 50.0, 1500)
    record = record_of(effects={"supply_quantisation": {"step_V": step_V}}, voltage_V=volts)
    observations = (observe(record),)
    bench = problem_of(PAPER, observations)
    form = next(x for x in candidate_forms(PAPER, observations) if x.effect == "supply_quantisation")
    start, *_ = scan_any(bench, Hypothesis(), form, NOISE_um)
    assert start.values[0] == pytest.approx(step_V, rel=1e-3)
    for share in np.linspace(-2e-3, 2e-3, 41):
        left = training_residual(bench, Hypothesis().plus(form, (start.values[0] * (1.0 + float(share)),)))
        assert left is not None
        assert float(left @ left) > 0.98 * start.square


def test_steps_of_a_sensor_show_although_a_hum_moves_every_reading():
    hum = {"sine_um": 5.0, "cosine_um": 1.0, "frequency_Hz": 5.3}
    record = record_of(effects={"periodic_disturbance": hum})
    coarse = Record(record.time_s, record.voltage_V, 1.5 * np.round(record.displacement_um / 1.5))
    found = find(search_records(PAPER, [coarse]))
    assert found.verdict == "named"
    assert {x.id for x in found.added} == {"periodic_disturbance", "sensor_quantisation"}
    step = next(x for x in found.added if x.id == "sensor_quantisation").numbers[0]
    assert step.value == pytest.approx(1.5, rel=1e-6)
