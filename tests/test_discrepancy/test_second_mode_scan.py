"""A second mode between the starts of its form is sought where a ringing takes most off the residual."""

import numpy as np
import pytest

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.fitting.fit_problem import problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.scans.chosen import scan_any
from bender_discrepancy.records.observations import observe
from bender_discrepancy.workflow import candidate_forms
from bender_loop.records.record import Record
from bender_plant.model import load_model

PAPER = load_model("paper")
NOISE_UM = 0.02
ROWS = 6_000


@pytest.mark.parametrize(("frequency_Hz", "late_s"), [(276.8, 0.0), (276.8, 1e-4), (483.0, 0.0), (733.0, 0.0)])
def test_a_faint_mode_between_two_starts_is_found(frequency_Hz: float, late_s: float) -> None:
    time_s = np.arange(ROWS) / 4_000.0
    volts = np.random.default_rng(5).uniform(0.0, 50.0, size=ROWS // 60).repeat(60)
    plant = PAPER.with_block("second_mode", share=0.01, frequency_Hz=frequency_Hz, damping_ratio=0.005)
    reading_um = Simulator(Drive.of_rows(time_s, volts, time_s + late_s)).run(plant).reading_um
    reading_um += NOISE_UM * np.random.default_rng(6).standard_normal(ROWS)
    record = Record(time_s, volts, reading_um, command_time_s=time_s + late_s)
    problem = problem_of(PAPER, (observe(record),))
    form = next(x for x in candidate_forms(PAPER, problem.observations) if x.effect == "second_mode")
    assert min(abs(x / frequency_Hz - 1.0) for x in form.free[1].starts) > 0.1
    best = scan_any(problem, Hypothesis(), form, NOISE_UM)[0]
    assert best.values[1] == pytest.approx(frequency_Hz, rel=0.01)
    assert best.values[0] == pytest.approx(0.01, rel=0.5)


def test_uneven_rows_leave_the_starts_as_they_are() -> None:
    rng = np.random.default_rng(5)
    time_s = (np.arange(ROWS) + rng.uniform(0.0, 0.4, size=ROWS)) / 4_000.0
    volts = rng.uniform(0.0, 50.0, size=ROWS // 60).repeat(60)
    reading_um = Simulator(Drive.of_rows(time_s, volts)).run(PAPER).reading_um + NOISE_UM * rng.standard_normal(ROWS)
    problem = problem_of(PAPER, (observe(Record(time_s, volts, reading_um)),))
    form = next(x for x in candidate_forms(PAPER, problem.observations) if x.effect == "second_mode")
    starts = scan_any(problem, Hypothesis(), form, NOISE_UM, keep=100)
    assert starts
    assert {x.values[1] for x in starts} <= set(form.free[1].starts)
