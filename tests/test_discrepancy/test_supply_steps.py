"""Steps of the supply are sought in what the plant makes of rounding: a mode rings on, and a loop rings with it."""

import numpy as np
import pytest
from few import few
from reported_diagnosis import hypothesis

from bender_compiled.simulation import Drive, Simulator
from bender_discrepancy.fitting.fit_problem import FitProblem, problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import judge
from bender_discrepancy.fitting.scans.chosen import scan_any
from bender_discrepancy.records.observations import observe
from bender_loop.records.record import Record
from bender_plant.model import load_model

PAPER = load_model("paper")
ROW_S, NOISE_um = 1.0 / 4000.0, 0.02


def rung(step_V: float, gain: float = 1.0) -> Record:
    """What a vibrometer sees of steps and of a chirp through the resonance, of a supply that rounds."""
    rng = np.random.default_rng(2)
    time_s = ROW_S * np.arange(6000.0)
    steps = np.repeat(rng.uniform(5.0, 45.0, 60), 50)
    chirp = 25.0 + 2.0 * np.sin(2.0 * np.pi * (60.0 + 60.0 * time_s[3000:]) * time_s[3000:])
    volts = np.round(np.r_[steps, chirp], 3)
    plant = PAPER.with_block("supply_quantisation", step_V=step_V) if step_V else PAPER
    reading_um = Simulator(Drive.of_rows(time_s, volts)).run(plant).reading_um
    return Record(time_s, volts, gain * reading_um + NOISE_um * rng.standard_normal(time_s.size))


def problem(record: Record) -> FitProblem:
    return problem_of(PAPER, (observe(record),))


@pytest.mark.parametrize("step_V", few([0.37, 1.007, 2.6], 0))
def test_steps_are_found_behind_a_mode_that_rings(step_V: float) -> None:
    record = rung(step_V, gain=0.8)
    known = problem(record)
    form = hypothesis(PAPER, [record], ("supply_quantisation", (step_V,))).parts[0].form
    best = scan_any(known, Hypothesis(), form, NOISE_um)[0]
    assert best.values[0] == pytest.approx(step_V, rel=2e-3)
    base = judge(known, Hypothesis())
    assert base is not None
    assert best.square < 0.3 * base.training_square


@pytest.mark.parametrize(("height_V", "any_step"), [(0.0, False), (1.0, True)])
def test_no_step_is_sought_where_nothing_is_commanded(height_V: float, any_step: bool) -> None:
    time_s = np.arange(400) / 30.0
    volts = height_V * np.round(np.random.default_rng(4).uniform(size=40).repeat(10), 1)
    volts[20:30] = height_V
    reading_um = Simulator(Drive.of_rows(time_s, volts)).run(PAPER).reading_um
    record = Record(time_s, volts, reading_um + NOISE_um * np.random.default_rng(5).standard_normal(400))
    form = hypothesis(PAPER, [rung(0.37)], ("supply_quantisation", (0.37,))).parts[0].form
    assert bool(scan_any(problem(record), Hypothesis(), form, NOISE_um)) is any_step


@pytest.mark.parametrize("step_V", [1.3, 2.09])
def test_steps_are_found_by_a_camera_whose_frames_are_uneven(step_V: float) -> None:
    """Between two frames the mode rings three times and more: no step response at the rows tells how."""
    rng = np.random.default_rng(6)
    time_s = np.cumsum(1.0 / 30.0 + 0.004 * rng.uniform(-1.0, 1.0, 2400))
    volts = np.round(np.r_[np.linspace(0.0, 50.0, 1200), np.repeat(rng.uniform(0.0, 50.0, 120), 10)], 3)
    plant = PAPER.with_block("supply_quantisation", step_V=step_V)
    reading_um = Simulator(Drive.of_rows(time_s, volts)).run(plant).reading_um
    record = Record(time_s, volts, reading_um + 0.06 * rng.standard_normal(time_s.size))
    form = hypothesis(PAPER, [record], ("supply_quantisation", (step_V,))).parts[0].form
    best = scan_any(problem(record), Hypothesis(), form, 0.06)[0]
    assert best.values[0] == pytest.approx(step_V, rel=2e-3)


@pytest.mark.parametrize("step_V", [0.29, 0.45])
def test_fine_steps_are_found_where_every_command_is_another_and_their_rounding_looks_like_noise(step_V: float) -> None:
    """As in a closed loop: the noise floor of the first residual is three times that of the sensor."""
    rng = np.random.default_rng(8)
    time_s = np.cumsum(1.0 / 30.0 + 0.004 * rng.uniform(-1.0, 1.0, 1500))
    volts = np.round(20.0 + 15.0 * np.sin(0.2 * time_s) + 3.0 * np.sin(3.1 * time_s), 3)
    plant = PAPER.with_block("supply_quantisation", step_V=step_V)
    reading_um = Simulator(Drive.of_rows(time_s, volts)).run(plant).reading_um
    record = Record(time_s, volts, reading_um + 0.06 * rng.standard_normal(time_s.size))
    form = hypothesis(PAPER, [record], ("supply_quantisation", (step_V,))).parts[0].form
    best = scan_any(problem(record), Hypothesis(), form, 0.2)[0]
    assert best.values[0] == pytest.approx(step_V, rel=2e-3)
