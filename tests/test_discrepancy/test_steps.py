"""Steps of the supply and of the sensor: how finely they are found, and where readings never stand still."""

from dataclasses import replace

import numpy as np
import pytest
from told_diagnosis import NOISE_um, record_of

from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.effects.form import Free, simple
from bender_discrepancy.fitting.fit_problem import Calibration, problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import Fitted, training_residual
from bender_discrepancy.fitting.special_starts import scan_any
from bender_discrepancy.records.observations import observe
from bender_discrepancy.search.evidence import simplest_as_good
from bender_discrepancy.search.step import most_promising_first
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


def a_model(name: str, numbers: int, square: float) -> Fitted:
    """A hypothesis of one effect with so many numbers, which leaves so much."""
    free = tuple(Free(f"{name}_{k}", 0.0, 2.0, False, (1.0,)) for k in range(numbers))
    hypothesis = Hypothesis().plus(simple(name, *free), (1.0,) * numbers)
    return Fitted(hypothesis, Calibration(1.0, (0.0,)), (), square, square)


def beside(first: Fitted, name: str, numbers: int, square: float) -> Fitted:
    """A hypothesis with one effect more, which leaves so much."""
    added = a_model(name, numbers, square)
    part = added.hypothesis.parts[0]
    return replace(added, hypothesis=first.hypothesis.plus(part.form, part.values))


def test_what_forms_in_common_close_is_no_measure_of_what_others_may_be_off():
    """A delay closes nearly all of the gap; beside it a lens closes most of the rest, a play hardly a tenth."""
    base, delay = Fitted(Hypothesis(), Calibration(1.0, (0.0,)), (), 50.0, 50.0), a_model("delay", 1, 2.5)
    lens, play = beside(delay, "lens", 4, 0.1), beside(delay, "play", 1, 2.2)
    assert simplest_as_good([lens, play], (base, delay), nothing_left=False) is lens
    # at the first step, a simple form of what closes the whole gap may be off by a fifth of its size
    assert simplest_as_good([lens, play], (base,), nothing_left=False) is play
    other = a_model("other", 1, 2.4)
    assert simplest_as_good([lens, other], (base, delay), nothing_left=False) is other


def test_a_step_sets_out_from_the_model_that_leaves_least_unless_it_is_far_more_flexible():
    leader, nearer, flexible = a_model("leader", 1, 3.0), a_model("nearer", 2, 2.0), a_model("flexible", 8, 1.0)
    assert most_promising_first([leader, flexible, nearer]) == [nearer, leader, flexible]
    assert most_promising_first([flexible, leader, nearer]) == [flexible, nearer, leader]
    assert most_promising_first([]) == []
