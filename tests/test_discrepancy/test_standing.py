"""What standing numbers take over beside a further effect, against fits of all numbers at once."""

import numpy as np
import pytest
from reported_diagnosis import hypothesis, levels, record_of

from bender_discrepancy.fitting import output_error
from bender_discrepancy.fitting.fit_problem import FitProblem, problem_of
from bender_discrepancy.fitting.output_error import fit
from bender_discrepancy.fitting.scans.chosen import scan_any
from bender_discrepancy.fitting.standing import Standing, standing
from bender_discrepancy.records.observations import observe
from bender_discrepancy.workflow import candidate_forms
from bender_plant.model import load_model

PAPER = load_model("paper")
BOTH = {"source_resistance": {"time_constant_s": 0.08}, "electrostriction": {"coefficient_um_per_V2": 0.001}}


def lagging(values: float = 0.05) -> tuple[FitProblem, output_error.Fitted, output_error.Fitted]:
    """A record with two effects: the problem, one effect fitted, both fitted."""
    record = record_of(effects=BOTH, voltage_V=levels(30.0))
    problem = problem_of(PAPER, (observe(record),))
    lag = fit(problem, hypothesis(PAPER, [record], ("source_resistance", (values,))))
    two = fit(problem, hypothesis(PAPER, [record], ("source_resistance", (0.05,)), ("electrostriction", (0.004,))))
    assert lag is not None
    assert two is not None
    return problem, lag, two


def test_it_projects_as_least_squares_do() -> None:
    rng = np.random.default_rng(3)
    slopes, column = rng.normal(size=(400, 3)), rng.normal(size=400)
    left = np.linalg.lstsq(slopes, column, rcond=None)[1][0]
    free = Standing(slopes, np.zeros(3), np.linalg.qr(np.concatenate([slopes, np.zeros((3, 3))]))[0])
    assert free.square(column) == pytest.approx(left, rel=1e-9)
    # what the numbers can do alone is gone
    assert free.square(slopes @ np.array([1.0, -2.0, 0.5])) == pytest.approx(0.0, abs=1e-9)


def test_a_scan_beside_it_promises_what_a_fit_of_all_numbers_finds() -> None:
    problem, lag, two = lagging()
    form = next(x for x in candidate_forms(PAPER, list(problem.observations)) if x.name == "electrostriction")
    (alone,) = scan_any(problem, lag.hypothesis, form, 0.06, 1)
    (beside,) = scan_any(problem, lag.hypothesis, form, 0.06, 1, standing(problem, lag))
    assert beside.square < alone.square
    assert beside.square == pytest.approx(two.training_square, rel=0.1)
    assert beside.values == pytest.approx(two.hypothesis.values()[1:], rel=0.1)


def test_a_model_without_numbers_takes_over_nothing() -> None:
    problem, _, two = lagging()
    bare = fit(problem, two.hypothesis.minus(1).minus(0))
    assert bare is not None
    found = standing(problem, bare)
    column = np.random.default_rng(1).normal(size=found.slopes.shape[0])
    assert found.slopes.shape[1] == 0
    assert found.without_it(column) == pytest.approx(column)
