"""Misread frames: set aside whatever stands beside them, and whatever the readings' lattice."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import levels, record_of

from bender_discrepancy.conclusion.findings import find
from bender_discrepancy.records.digits import lattice_step_um
from bender_discrepancy.records.observations import observe
from bender_discrepancy.records.outliers import outlying
from bender_discrepancy.workflow import search_records
from bender_loop.records.record import Record
from bender_plant.model import load_model

NOISE_um = 0.06


def misread(record: Record, rows: list[int], by_um: float = 4.0) -> Record:
    readings = np.array(record.displacement_um)
    readings[rows] += by_um
    return Record(record.time_s, record.voltage_V, readings)


@examples(max_examples=25)
@given(st.integers(0, 1000), st.integers(0, 597))
@example(1, 0)
@example(1, 597)
def test_two_that_nearly_touch_are_both_found(seed: int, row: int) -> None:
    """Away from jumps of the command, white noise with two misread frames one row apart."""
    rng = np.random.default_rng(seed)
    residual = NOISE_um * rng.standard_normal(600)
    residual[[row, row + 2]] += [3.0, -5.0]
    still = observe(Record(np.arange(600) / 30.0, 0.01 * np.arange(600.0), residual))
    assert list(np.flatnonzero(outlying(still, residual, NOISE_um))) == [row, row + 2]


@pytest.mark.parametrize("step_um", [0.4, 1.3])
def test_a_lattice_is_seen_although_some_readings_are_off_it(step_um: float) -> None:
    rng = np.random.default_rng(3)
    readings = step_um * np.round(rng.uniform(0.0, 40.0, 2000) / step_um)
    readings[rng.choice(2000, 20, replace=False)] += rng.uniform(1.5, 20.0, 20)
    assert lattice_step_um(readings) == pytest.approx(step_um, rel=1e-6)
    assert lattice_step_um(rng.normal(size=2000)) == 0.0


@pytest.mark.slow
def test_an_effect_is_found_through_misread_and_lost_frames() -> None:
    record = record_of(effects={"charge_leakage": {"fraction": 0.2, "time_constant_s": 5.0}}, voltage_V=levels(40.0))
    rng = np.random.default_rng(5)
    rows = rng.choice(np.arange(20, 1200), 36, replace=False)
    wrong = misread(record, sorted(int(x) for x in rows[:12]), 2.5)
    readings = np.array(wrong.displacement_um)
    readings[rows[12:]] = np.nan
    found = search_records(load_model("paper"), [Record(record.time_s, record.voltage_V, readings)])
    assert found.verdict.word == "named"
    assert found.best.hypothesis.effects == ("charge_leakage",)
    aside = set(np.flatnonzero(np.isfinite(readings) & ~found.problem.observations[0].usable))
    assert aside == set(rows[:12])


@pytest.mark.parametrize("seed", [0, *(pytest.param(x, marks=pytest.mark.slow) for x in (1, 2))])
def test_what_noise_does_at_the_edges_of_steps_has_no_name(seed: int) -> None:
    """Readings in steps far above the noise: nothing is missing but the steps."""
    fine = record_of(voltage_V=levels(40.0, seed), seed=seed)
    coarse = Record(fine.time_s, fine.voltage_V, 1.3 * np.round(fine.displacement_um / 1.3))
    assert [x.id for x in find(search_records(load_model("paper"), [coarse])).added] == ["sensor_quantisation"]
