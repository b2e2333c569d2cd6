"""Steps of the supply and of the sensor: how finely they are found, and where readings never stand still."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from reported_diagnosis import NOISE_um, record_of, told

from bender_discrepancy import workflow
from bender_discrepancy.conclusion.coarse_readings import step_in_motion_um
from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.effects.form import Free, simple
from bender_discrepancy.fitting.fit_problem import Calibration, problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import Fitted, training_residual
from bender_discrepancy.fitting.scans.chosen import scan_any
from bender_discrepancy.records.digits import jitter_um
from bender_discrepancy.records.observations import observe
from bender_discrepancy.search.result import Interrupted, SearchResult
from bender_discrepancy.workflow import candidate_forms, search_records
from bender_loop.records.record import Record
from bender_plant.model import load_model
from bender_plant.plant import Plant

PAPER, BENCH = load_model("paper"), load_model("bench")


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


@pytest.mark.slow
def test_steps_of_a_sensor_show_although_a_hum_moves_every_reading():
    hum = {"sine_um": 5.0, "cosine_um": 1.0, "frequency_Hz": 5.3}
    record = record_of(effects={"periodic_disturbance": hum})
    coarse = Record(record.time_s, record.voltage_V, 1.5 * np.round(record.displacement_um / 1.5))
    found = find(search_records(PAPER, [coarse]))
    assert found.verdict == "named"
    assert {x.id for x in found.added} == {"periodic_disturbance", "sensor_quantisation"}
    step = next(x for x in found.added if x.id == "sensor_quantisation").numbers[0]
    assert step.value == pytest.approx(1.5, rel=1e-6)


def looped(step_um: float, seed: int = 5, rows: int = 900, row_s: float = 1.0 / 30.0) -> Record:
    """A loop whose controller follows every step of its sensor, so that neither command nor tip ever stands."""
    plant, noise = Plant(BENCH), NOISE_um * np.random.default_rng(seed).standard_normal(rows)
    state, voltage_V, integral_V, before_um = plant.initial(), 0.0, 0.0, 0.0
    volts, readings = np.zeros(rows), np.zeros(rows)
    for k in range(rows):
        if k:
            state, reading_um, _ = plant.step(state, voltage_V, (k - 1) * row_s, row_s)
            readings[k] = step_um * np.rint((reading_um + noise[k]) / step_um)
        error_um = 10.0 + 6.0 * np.sin(0.4 * k * row_s) - readings[k]
        integral_V += 3.0 * error_um * row_s
        voltage_V = integral_V + 0.8 * error_um - 0.02 * (readings[k] - before_um) / row_s
        before_um, volts[k] = readings[k], voltage_V
    return Record(row_s * np.arange(rows, dtype=np.float64), volts, readings)


@pytest.mark.slow
def test_steps_of_a_sensor_show_although_a_loop_follows_each_of_them():
    record = looped(1.25)
    assert np.mean(jitter_um(record.displacement_um, record.voltage_V) < 1.25 / 2.0) < 0.2
    told: list[str] = []
    found = find(search_records(BENCH, [record], progress=told.append))
    assert any("searching again" in x for x in told)
    assert (found.verdict, found.complete, [x.id for x in found.added]) == ("named", True, ["sensor_quantisation"])


@pytest.mark.slow
def test_records_of_one_sensor_have_one_step():
    """Each finds it in its own readings, equal but for the last digits of a sum."""
    records = [looped(1.5 / 7.0, seed) for seed in (5, 6)]
    assert step_in_motion_um(told(records, base=BENCH)) == pytest.approx(1.5 / 7.0, rel=1e-9)
    assert step_in_motion_um(told([records[0], looped(1.7 / 7.0)], base=BENCH)) == 0.0


@pytest.mark.slow
def test_an_interrupt_of_the_second_search_keeps_the_first(monkeypatch: pytest.MonkeyPatch):
    done: list[SearchResult] = []
    search = workflow._searched

    def once(*arguments: Any) -> SearchResult:
        if done:
            raise KeyboardInterrupt
        done.append(search(*arguments))
        return done[0]

    monkeypatch.setattr(workflow, "_searched", once)
    with pytest.raises(Interrupted) as stop:
        search_records(BENCH, [looped(1.25)])
    assert stop.value.search is done[0]
    assert stop.value.searched


def a_model(name: str, numbers: int, square: float) -> Fitted:
    """A hypothesis of one effect with so many numbers, which leaves so much."""
    free = tuple(Free(f"{name}_{k}", 0.0, 2.0, False, (1.0,)) for k in range(numbers))
    hypothesis = Hypothesis().plus(simple(name, *free), (1.0,) * numbers)
    return Fitted(hypothesis, Calibration(1.0, (0.0,)), (), square, square)


def beside(first: Fitted, name: str, mean_square: float, rows: int) -> Fitted:
    """A hypothesis with one effect more, which leaves so much in every row."""
    added = a_model(name, 1, 0.5 * mean_square * rows)
    return replace(added, hypothesis=first.hypothesis.plus(added.hypothesis.parts[0].form, (1.0,)))
