"""Of coarse readings, a scan promises squares with the steps and a fit tells them beyond the steps."""

from dataclasses import replace

import numpy as np
import pytest
from reported_diagnosis import hypothesis, levels, record_of

from bender_discrepancy.fitting.fit_problem import FitProblem, problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import judge
from bender_discrepancy.records.observations import observe
from bender_loop.records.record import Record
from bender_plant.model import load_model

PAPER = load_model("paper")
STEP_UM = 0.8
DRIFT = {"amplitude_um": 5.0, "time_constant_s": 25.0}


def coarse(effects: dict[str, dict[str, float]]) -> tuple[Record, FitProblem]:
    """A record with the effects, rounded to steps, and the problem in which these are known."""
    exact = record_of(effects=effects, voltage_V=levels(80.0))
    record = Record(exact.time_s, exact.voltage_V, STEP_UM * np.round(exact.displacement_um / STEP_UM))
    return record, problem_of(PAPER, (replace(observe(record), half_step_um=0.5 * STEP_UM),))


def test_what_steps_leave_is_what_a_scan_sees_of_them_at_the_right_place() -> None:
    record, problem = coarse({"thermal_drift": DRIFT})
    right = hypothesis(PAPER, [record], ("thermal_drift", tuple(DRIFT.values())))
    readings = problem.readings(right)
    assert readings is not None
    x = problem.observations[0]
    raw = (x.measured_um - readings[0])[x.training]
    told = judge(problem, right)
    assert told is not None
    assert problem.square_with_steps(told.residuals) == pytest.approx(float(raw @ raw), rel=0.1)
    assert told.training_square < 0.01 * float(raw @ raw)


def test_without_steps_both_are_the_same() -> None:
    record = record_of(effects={"thermal_drift": DRIFT})
    problem = problem_of(PAPER, (observe(record),))
    told = judge(problem, Hypothesis())
    assert told is not None
    assert problem.square_with_steps(told.residuals) == pytest.approx(told.training_square, rel=1e-12)
