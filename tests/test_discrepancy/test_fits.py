"""Fits: where they set out and end, numbers whose misfit changes in jumps, what standing numbers take over."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from reported_diagnosis import hypothesis, levels, record_of, told

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.record_search import search_records
from bender_effects.form import amplitude, simple
from bender_inference.candidates import candidate_forms
from bender_inference.fitting import output_error, starts
from bender_inference.fitting.fit_problem import FitProblem, problem_of
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.level_cell import Cell, cell_of, cell_V, centred, is_undetermined
from bender_inference.fitting.output_error import WORTH, Fitted, fit, judge
from bender_inference.fitting.scans.chosen import scan_any
from bender_inference.fitting.scans.jumps import FINER_AND_FINER, middle_of_equal_fits, minimise_in_jumps
from bender_inference.fitting.standing import Standing, standing
from bender_inference.fitting.uncertainty import uncertainty
from bender_inference.records.observations import observe
from bender_inference.search import explore
from bender_inference.search.moves import Catalogue, Kit
from bender_loop.records.record import Record
from bender_plant.model import load_model

PAPER = load_model("paper")
LOOP = {"form": "plays", "thresholds_V": (1.0, 3.0, 6.0), "weights_um_per_V": (0.2, 0.12, 0.06)}
FEW_NUMBERS, MANY_NUMBERS = "Bouc-Wen", "10 plays"


def looping(beside_um: float, form: str) -> tuple[FitProblem, Hypothesis]:
    """A loop, a slow swing beside it that no loop explains, and a form of hysteresis to fit."""
    plain = record_of(effects={"rate_independent_hysteresis": LOOP}, voltage_V=levels(60.0))
    swing_um = beside_um * np.sin(2.0 * np.pi * plain.time_s / 9.0)
    observations = (observe(Record(plain.time_s, plain.voltage_V, plain.displacement_um + swing_um)),)
    found = next(x for x in candidate_forms(PAPER, observations) if x.name == form)
    return problem_of(PAPER, observations), Hypothesis().plus(found, tuple(x.starts[0] for x in found.free))


def test_the_end_of_a_fit_is_no_worse_and_hardly_better() -> None:
    soon, late = (fit(*looping(3.0, MANY_NUMBERS), most_evaluations=60, closely=x) for x in (False, True))
    assert soon is not None
    assert late is not None
    assert (1.0 - 4.0 * WORTH) * soon.training_square <= late.training_square <= soon.training_square


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


STEP_V = 4.386


@given(st.floats(0.01, 100.0), st.floats(-0.9, 0.9), st.floats(3.0, 300.0))
@examples(max_examples=30)
def test_a_value_is_moved_to_where_a_stair_of_squares_is_deepest(start: float, place: float, stairs: float) -> None:
    deepest = start * (1.0 + place * FINER_AND_FINER[0])
    height = FINER_AND_FINER[0] / stairs

    def square_at(value: float) -> float:
        return float(np.floor(abs(value / deepest - 1.0) / height))

    value, square = minimise_in_jumps(start, square_at(start), square_at)
    assert square == square_at(value) <= square_at(start)
    assert abs(value / deepest - 1.0) <= max(height, 2.0 * FINER_AND_FINER[-1])


@given(st.floats(0.01, 100.0), st.floats(2e-5, 5e-4), st.floats(0.05, 0.95))
@examples(max_examples=30)
def test_of_what_fits_alike_the_middle_is_taken(low: float, width: float, place: float) -> None:
    high = low * (1.0 + width)
    value = low + place * (high - low)
    middle = middle_of_equal_fits(value, 1.0, lambda x: 0.5 if low <= x <= high else 2.0)
    assert abs(middle - 0.5 * (low + high)) <= 0.2 * (high - low)


def test_a_middle_that_fits_worse_is_not_taken() -> None:
    assert middle_of_equal_fits(1.0, 1.0, lambda x: 0.5 if x == 1.0 or x > 1.00001 else 2.0) == 1.0


def _beside_creep(start_V: float, seed: int = 7) -> tuple[Fitted, Fitted]:
    """Return a fit of steps of the supply, damping and creep that sets out from other numbers, and the true ones."""
    volts = levels(40.0)
    slow = {"gains": (0.08,), "time_constants_s": (1.2,)}
    effects = {
        "supply_quantisation": {"step_V": STEP_V},
        "creep": slow,
        "structural_damping": {"damping_ratio": 0.0247},
    }
    record = record_of("beam", effects, volts, seed=seed)
    beam = load_model("beam")
    problem = problem_of(beam, (observe(record),))

    def parts(step_V: float, gain: float, tau_s: float, damping: float) -> Fitted | None:
        steps, crept = ("supply_quantisation", (step_V,)), ("1 relaxation", (gain, tau_s))
        told = hypothesis(beam, [record], steps, crept, ("structural_damping", (damping,)))
        return fit(problem, told) if step_V != STEP_V else judge(problem, told)

    found, true = parts(start_V, 0.03, 0.5, 0.02), parts(STEP_V, 0.08, 1.2, 0.0247)
    assert found is not None
    assert true is not None
    return found, true


@pytest.mark.parametrize("off", [-6e-4, 3e-4, 8e-4])
def test_steps_of_the_supply_do_not_keep_the_numbers_beside_them_from_theirs(off: float) -> None:
    found, true = _beside_creep(STEP_V * (1.0 + off))
    assert found.training_square <= 1.01 * true.training_square
    assert found.held_square <= 1.05 * true.held_square
    step_V, gain, tau_s, damping = found.hypothesis.values()
    assert math.isclose(step_V, STEP_V, rel_tol=2e-3)
    assert math.isclose(gain, 0.08, rel_tol=0.05)
    assert math.isclose(tau_s, 1.2, rel_tol=0.1)
    assert math.isclose(damping, 0.0247, rel_tol=0.05)
    assert found.covariance is not None


CELL_STEP_V = 1.7


@given(st.lists(st.floats(-50.0, 50.0), min_size=2, max_size=12), st.floats(0.3, 5.0))
@examples(max_examples=25)
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
    record = record_of("beam", {"supply_quantisation": {"step_V": CELL_STEP_V}}, volts)
    beam = load_model("beam")
    problem = problem_of(beam, (observe(record),))
    low, high = cell_V([x.drive.voltage_V for x in problem.observations], CELL_STEP_V)
    assert low < CELL_STEP_V < high
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
    assert abs(found[0] - CELL_STEP_V) <= 0.5 * (high - low)


def test_commands_that_run_between_their_levels_have_no_cell() -> None:
    record = record_of("beam", {"supply_quantisation": {"step_V": CELL_STEP_V}}, linear=True)
    beam = load_model("beam")
    problem = problem_of(beam, (observe(record, True),))
    fitted = judge(problem, hypothesis(beam, [record], ("supply_quantisation", (CELL_STEP_V,))))
    assert fitted is not None
    assert cell_of(problem, fitted) is None
    assert centred(problem, fitted) is fitted


def test_where_the_plant_bends_the_readings_tell_the_step_and_its_cell_does_not_apply() -> None:
    volts = np.round(levels() / 8.0) * 8.0
    beam = load_model("beam").with_block("saturation", scale_V=40.0)
    record = record_of(beam, {"supply_quantisation": {"step_V": CELL_STEP_V}}, volts)
    problem = problem_of(beam, (observe(record),))
    fitted = judge(problem, hypothesis(beam, [record], ("supply_quantisation", (CELL_STEP_V,))))
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


def test_an_amplitude_that_sets_out_from_nought_is_tried_with_its_unit() -> None:
    """What it does is linear in it: with warnings as errors, a division by nought would end this."""
    times = np.linspace(0.0, 4.0, 200)
    volts = np.random.default_rng(1).uniform(-20.0, 20.0, 20).repeat(10)
    beam = load_model("beam")
    read = Simulator(Drive.of_rows(times, volts)).run(beam.with_block("electrostriction", coefficient_um_per_V2=1e-3))
    problem = problem_of(beam, (observe(Record(times, volts, read.reading_um)),))
    form = simple("electrostriction", amplitude("coefficient_um_per_V2", 1e-4, 1.0))
    from_nought = replace(form, free=(replace(form.free[0], starts=(-0.0,)),))
    (usual,), (found,) = (starts.scan(problem, Hypothesis(), x) for x in (form, from_nought))
    assert found.values == pytest.approx(usual.values, rel=1e-6)
    assert found.values[0] == pytest.approx(1e-3, rel=1e-3)


@pytest.mark.parametrize("error", [np.linalg.LinAlgError, FloatingPointError, OverflowError])
def test_a_fit_in_which_nothing_can_be_solved_for_has_no_result(
    error: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise error("SVD did not converge")

    record = record_of(effects={"source_resistance": {"time_constant_s": 0.08}})
    problem = problem_of(PAPER, (observe(record),))
    monkeypatch.setattr(output_error, "least_squares", fails)
    assert fit(problem, hypothesis(PAPER, [record], ("source_resistance", (0.05,)))) is None


LAG = "source_resistance"


WHERE: list[tuple[Any, str, Callable[..., bool], tuple[str, ...]]] = [
    (output_error, "training_residual", lambda _, tried, *__: tried.effects not in ((), (LAG,)), (LAG,)),
    (explore, "scan_any", lambda _, __, form, *___: form.effect != LAG, (LAG,)),
    (explore, "standing", lambda *_: True, ()),
]


@pytest.mark.parametrize(("module", "name", "cannot", "left"), WHERE, ids=[x for _, x, *_ in WHERE])
def test_a_hypothesis_in_which_nothing_can_be_solved_for_does_not_end_the_search(
    module: Any, name: str, cannot: Callable[..., bool], left: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    real, failed = getattr(module, name), []

    def fails(*given: Any, **further: Any) -> Any:
        if cannot(*given):
            failed.append(given)
            raise np.linalg.LinAlgError("SVD did not converge")
        return real(*given, **further)

    monkeypatch.setattr(module, name, fails)
    beam = load_model("beam")
    found = search_records(beam, [record_of(beam, {LAG: {"time_constant_s": 0.06}}, levels(8.0))])
    assert failed
    assert found.best.hypothesis.effects == left


def test_nor_does_it_end_what_is_sought_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise np.linalg.LinAlgError("SVD did not converge")

    record = record_of(effects={LAG: {"time_constant_s": 0.06}})
    found = told([record], base=PAPER)
    kit = Kit(None, tuple(candidate_forms(PAPER, found.problem.observations)))
    sought = (found.archive, Catalogue((kit,)), [found.best], found.best.training_square)
    monkeypatch.setattr(explore, "standing", fails)
    assert explore.explore_beside_each(*sought) == []
    monkeypatch.undo()
    assert explore.explore_beside_each(*sought)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_columns_that_are_no_numbers_promise_nothing(bad: float) -> None:
    """LAPACK refuses to solve for them."""
    column = np.linspace(0.0, 1.0, 20)
    broken = np.where(column > 0.5, bad, column)
    assert starts.solved([broken], column)[1] == math.inf
    assert starts.solved_with_signs([column], broken, np.array([True]))[1] == math.inf
