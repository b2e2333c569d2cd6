"""The step of a quantiser: its cell against a scan, its middle found from anywhere in it, its deviation honest."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import hypothesis, levels, record_of

from bender_discrepancy.fitting.fit_problem import problem_of
from bender_discrepancy.fitting.level_cell import Cell, cell_of, cell_V, centred, is_undetermined
from bender_discrepancy.fitting.output_error import fit, judge
from bender_discrepancy.fitting.uncertainty import uncertainty
from bender_discrepancy.records.observations import observe
from bender_plant.model import load_model

STEP_V = 1.7


@given(st.lists(st.floats(-50.0, 50.0), min_size=2, max_size=12), st.floats(0.3, 5.0))
@examples(max_examples=50, deadline=None)
def test_within_its_cell_every_command_stays_on_its_level(commands: list[float], step_V: float) -> None:
    u = np.array([*commands, 40.0])
    low, high = cell_V([u], step_V)
    assert low <= step_V * (1.0 + 1e-12)
    assert high >= step_V * (1.0 - 1e-12)
    levels_there = np.rint(u / step_V)
    for inside in (low + 1e-9 + 0.01 * (high - low), high - 1e-9 - 0.01 * (high - low)):
        if low < inside < high:
            assert np.array_equal(np.rint(u / inside), levels_there)
    assert math.isfinite(high)
    assert not np.array_equal(np.rint(u / (high * (1.0 + 1e-6))), levels_there)


def test_the_middle_is_found_from_anywhere_in_the_cell_and_the_truth_lies_within_the_deviation() -> None:
    volts = np.round(levels(), 1)
    record = record_of("beam", {"supply_quantisation": {"step_V": STEP_V}}, volts)
    beam = load_model("beam")
    problem = problem_of(beam, (observe(record),))
    low, high = cell_V([x.drive.voltage_V for x in problem.observations], STEP_V)
    assert low < STEP_V < high
    found = []
    for part in (0.05, 0.5, 0.95):
        start = judge(problem, hypothesis(beam, [record], ("supply_quantisation", (low + part * (high - low),))))
        assert start is not None
        middle = centred(problem, start)
        found.append(middle.hypothesis.values()[0])
        assert math.isclose(middle.training_square, start.training_square, rel_tol=1e-8)
        determined = uncertainty(problem, middle)
        assert math.sqrt(determined.coordinates[0, 0]) * found[-1] >= 0.99 * (high - low) / math.sqrt(12.0)
    assert np.ptp(found) <= 1e-12
    assert abs(found[0] - STEP_V) <= 0.5 * (high - low)


def test_commands_that_run_between_their_levels_have_no_cell() -> None:
    record = record_of("beam", {"supply_quantisation": {"step_V": STEP_V}}, linear=True)
    beam = load_model("beam")
    problem = problem_of(beam, (observe(record, True),))
    fitted = judge(problem, hypothesis(beam, [record], ("supply_quantisation", (STEP_V,))))
    assert fitted is not None
    assert cell_of(problem, fitted) is None
    assert centred(problem, fitted) is fitted


def test_where_the_plant_bends_the_readings_tell_the_step_and_its_cell_does_not_apply() -> None:
    volts = np.round(levels() / 8.0) * 8.0
    beam = load_model("beam").with_block("saturation", scale_V=40.0)
    record = record_of(beam, {"supply_quantisation": {"step_V": STEP_V}}, volts)
    problem = problem_of(beam, (observe(record),))
    fitted = judge(problem, hypothesis(beam, [record], ("supply_quantisation", (STEP_V,))))
    assert fitted is not None
    cell = cell_of(problem, fitted)
    assert cell is not None
    assert not is_undetermined(problem, fitted, cell, 1e-6)
    assert centred(problem, fitted) is fitted
    assert is_undetermined(problem, fitted, cell, 1e9)


@given(st.floats(0.1, 10.0), st.floats(1e-6, 0.5), st.floats(0.0, 1.0))
def test_slopes_are_taken_within_the_cell_and_a_step_at_its_end_is_less_certain(
    low_V: float, part: float, place: float
) -> None:
    cell = Cell(0, low_V, low_V * (1.0 + part))
    step_V = low_V * (1.0 + place * part)
    down, up = cell.beside(step_V)
    assert cell.low_V < down < up < cell.high_V
    assert up - down >= 0.19 * (cell.high_V - cell.low_V)
    middle_V = 0.5 * (cell.low_V + cell.high_V)
    assert cell.variance(step_V) * step_V**2 >= cell.variance(middle_V) * middle_V**2 * (1.0 - 1e-9)


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_step_that_the_readings_hardly_tell_within_its_cell_has_a_deviation_that_says_so(seed: int) -> None:
    """A change of the readings where a command changes its level is no slope: it made the deviation far too small."""
    volts = levels(60.0, seed)
    record = record_of("paper", {"supply_quantisation": {"step_V": 7.953}}, volts, seed)
    paper = load_model("paper")
    problem = problem_of(paper, (observe(record),))
    fitted = fit(problem, hypothesis(paper, [record], ("supply_quantisation", (7.953,))))
    assert fitted is not None
    (step_V,) = fitted.hypothesis.values()
    cell = cell_of(problem, fitted)
    assert cell is not None
    deviation_V = float(np.sqrt(uncertainty(problem, fitted).coordinates[0, 0])) * step_V
    assert abs(step_V - 7.953) <= 3.0 * deviation_V
    assert deviation_V > 0.02 * (cell.high_V - cell.low_V)
