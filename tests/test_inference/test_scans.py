"""Scans: where a fit of a delay, of steps of the supply, of a faint effect or of a second mode sets out."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from few import few, few_rows
from reported_diagnosis import NOISE_um, hypothesis, levels, record_of

from bender_compiled.simulation import Drive, Simulator
from bender_effects.catalogue import EFFECTS
from bender_effects.effect import Sizes
from bender_effects.form import FAINTEST, Form, Free, scale, simple
from bender_identify.first_model.structures import Structure
from bender_inference.candidates import candidate_forms
from bender_inference.fitting.fit_problem import FitProblem, problem_of
from bender_inference.fitting.hypothesis import Hypothesis, Part
from bender_inference.fitting.output_error import fit, judge
from bender_inference.fitting.scans.chosen import scan_any
from bender_inference.fitting.scans.delay import scan_delay
from bender_inference.records.observations import observe
from bender_loop.records.record import Record
from bender_plant.model import load_model

PAPER = load_model("paper")
SIZES = Sizes(50.0, 23.1, 40.0, 104.4)


def ringing_um(time_s: np.ndarray, voltage_V: np.ndarray, delay_s: float) -> np.ndarray:
    """The answer of a gain and one mode of 104.373 Hz to held levels, in closed form, some time late."""
    omega, ratio, gain = 2.0 * math.pi * 104.373, 0.02, 0.46
    damped = omega * math.sqrt(1.0 - ratio**2)
    found = np.zeros(time_s.size)
    for at_s, jump_V in zip(time_s[1:], np.diff(voltage_V), strict=True):
        since = time_s - at_s - delay_s
        on = (since > 0.0) & (jump_V != 0.0)
        t = since[on]
        ring = np.exp(-ratio * omega * t) * (np.cos(damped * t) + ratio * omega / damped * np.sin(damped * t))
        found[on] += gain * jump_V * (1.0 - ring)
    return found


@pytest.mark.parametrize("delay_s", [0.0056, 0.0203, 0.0646, 0.1815])
def test_the_deepest_valley_of_a_delay_is_the_true_one(delay_s: float) -> None:
    plain = record_of(voltage_V=levels(30.0))
    noise_um = 0.05 * np.random.default_rng(2).standard_normal(len(plain))
    record = Record(plain.time_s, plain.voltage_V, ringing_um(plain.time_s, plain.voltage_V, delay_s) + noise_um)
    one_mode = load_model("beam").with_block("bending_modes", count=1, shares="unity", damping_ratio=0.02)
    problem = problem_of(one_mode, (observe(record),))
    form = EFFECTS["transport_delay"].forms(SIZES)[0]
    starts = scan_delay(problem, Hypothesis(), form, keep=1)
    assert starts[0].values[0] == pytest.approx(delay_s, abs=3e-4)
    assert starts[0].square < 0.5 * starts[1].square


@pytest.mark.parametrize("delay_s", [0.03, 0.08])
def test_a_record_whose_first_row_has_a_step_shows_its_delay(delay_s: float) -> None:
    """Before its first instant stands what was read there, not what a cubic runs away to."""
    stepped = levels(20.0)
    stepped[:60] = 30.0
    record = record_of(effects={"transport_delay": {"delay_s": delay_s}}, voltage_V=stepped)
    problem = problem_of(PAPER, (observe(record),))
    starts = scan_delay(problem, Hypothesis(), EFFECTS["transport_delay"].forms(SIZES)[0], keep=1)
    assert starts[0].values[0] == pytest.approx(delay_s, abs=1e-3)


def test_each_record_is_late_in_its_own_surroundings() -> None:
    """What is promised of two records that drift apart is what the two leave."""
    drifts = [{"thermal_drift": {"amplitude_um": x, "time_constant_s": 8.0}} for x in (6.0, -6.0)]
    late = {"transport_delay": {"delay_s": 0.03}}
    records = [record_of(effects=late | x, voltage_V=levels(20.0, seed=k)) for k, x in enumerate(drifts)]
    problem = problem_of(PAPER, tuple(observe(x) for x in records))
    drift = next(x for x in candidate_forms(PAPER, problem.observations) if x.name == "thermal_drift")
    base = Hypothesis((Part(drift, (6.0, 8.0, -6.0, 8.0)),))
    start = scan_delay(problem, base, EFFECTS["transport_delay"].forms(SIZES)[0], keep=1)[0]
    assert start.values[0] == pytest.approx(0.03, abs=1e-3)
    rows = sum(int(x.training.sum()) for x in problem.observations)
    assert start.square < 2.0 * rows * NOISE_um**2


@pytest.mark.parametrize(("rate_Hz", "is_sought"), [(30.0, False), (240.0, False), (2000.0, True), (math.inf, True)])
def test_a_second_mode_is_sought_only_where_rows_show_it_without_an_alias(rate_Hz: float, is_sought: bool) -> None:
    forms = EFFECTS["second_mode"].forms(Sizes(50.0, 23.1, 40.0, 104.4, highest_Hz=0.5 * rate_Hz))
    assert bool(forms) is is_sought
    assert all(x.free[1].high <= 0.5 * rate_Hz for x in forms)


def longest_s(volts: np.ndarray, time_s: np.ndarray, *, moving: bool) -> float:
    """The longest delay that is sought in a record of these commands."""
    seen = observe(Record(time_s, volts, 0.4 * volts))
    seen = replace(seen, start="motion" if moving else "rest")
    form = next(x for x in candidate_forms(PAPER, (seen,)) if x.effect == "transport_delay")
    return form.free[0].high / 2.0


@pytest.mark.parametrize("first_Hz", [12.0, 30.0])
def test_a_narrow_sweep_bounds_a_delay_by_its_slowest_period(first_Hz: float) -> None:
    """A delay of a period more is one shorter, and with a sign turned it imitates anything."""
    time_s = np.arange(20_000) / 750.0
    sweep = 5.0 * np.sin(2.0 * np.pi * (first_Hz * time_s + 0.1 * time_s**2))
    assert longest_s(sweep, time_s, moving=True) == pytest.approx(1.0 / first_Hz, rel=0.15)


def test_what_begins_at_once_shows_any_delay() -> None:
    """A burst of thirty periods from rest, levels, a sweep from slow to quick: their onset is late as a whole."""
    time_s = np.arange(3000) / 750.0
    burst = np.where(time_s < 1.0, 5.0 * np.sin(2.0 * np.pi * 30.0 * time_s), 0.0)
    quicker = 5.0 * np.sin(2.0 * np.pi * (0.5 * time_s + 10.0 * time_s**2))
    longest = EFFECTS["transport_delay"].covered["delay_s"][1]
    assert longest_s(burst, time_s, moving=False) > 5.0 / 30.0
    assert longest_s(25.0 + burst, time_s, moving=False) == longest
    assert longest_s(quicker, time_s, moving=True) == longest
    assert longest_s(levels(20.0), np.arange(600) / 30.0, moving=True) == longest


ROW_S, QUIET_um = 1.0 / 4000.0, 0.02


def rung(step_V: float, gain: float = 1.0) -> Record:
    """What a vibrometer sees of steps and of a chirp through the resonance, of a supply that rounds."""
    rng = np.random.default_rng(2)
    time_s = ROW_S * np.arange(6000.0)
    steps = np.repeat(rng.uniform(5.0, 45.0, 60), 50)
    chirp = 25.0 + 2.0 * np.sin(2.0 * np.pi * (60.0 + 60.0 * time_s[3000:]) * time_s[3000:])
    volts = np.round(np.r_[steps, chirp], 3)
    plant = PAPER.with_block("supply_quantisation", step_V=step_V) if step_V else PAPER
    reading_um = Simulator(Drive.of_rows(time_s, volts)).run(plant).reading_um
    return Record(time_s, volts, gain * reading_um + QUIET_um * rng.standard_normal(time_s.size))


def problem(record: Record) -> FitProblem:
    return problem_of(PAPER, (observe(record),))


@pytest.mark.parametrize("step_V", few([0.37, 1.007, 2.6], 0))
def test_steps_are_found_behind_a_mode_that_rings(step_V: float) -> None:
    record = rung(step_V, gain=0.8)
    known = problem(record)
    form = hypothesis(PAPER, [record], ("supply_quantisation", (step_V,))).parts[0].form
    best = scan_any(known, Hypothesis(), form, QUIET_um)[0]
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
    record = Record(time_s, volts, reading_um + QUIET_um * np.random.default_rng(5).standard_normal(400))
    form = hypothesis(PAPER, [rung(0.37)], ("supply_quantisation", (0.37,))).parts[0].form
    assert bool(scan_any(problem(record), Hypothesis(), form, QUIET_um)) is any_step


@pytest.mark.parametrize(
    ("step_V", "is_closed", "floor_um"), [(1.3, False, 0.06), (2.09, False, 0.06), (0.29, True, 0.2), (0.45, True, 0.2)]
)
def test_steps_are_found_by_a_camera_whose_frames_are_uneven(step_V: float, is_closed: bool, floor_um: float) -> None:
    """Between two frames the mode rings three times and more: no step response at the rows tells how.

    As in a closed loop, every command is another and the rounding of fine steps looks like noise: the noise floor of
    the first residual is three times that of the sensor.
    """
    rng = np.random.default_rng(8 if is_closed else 6)
    time_s = np.cumsum(1.0 / 30.0 + 0.004 * rng.uniform(-1.0, 1.0, 1500 if is_closed else 2400))
    if is_closed:
        volts = 20.0 + 15.0 * np.sin(0.2 * time_s) + 3.0 * np.sin(3.1 * time_s)
    else:
        volts = np.r_[np.linspace(0.0, 50.0, 1200), np.repeat(rng.uniform(0.0, 50.0, 120), 10)]
    volts = np.round(volts, 3)
    plant = PAPER.with_block("supply_quantisation", step_V=step_V)
    reading_um = Simulator(Drive.of_rows(time_s, volts)).run(plant).reading_um
    record = Record(time_s, volts, reading_um + 0.06 * rng.standard_normal(time_s.size))
    form = hypothesis(PAPER, [record], ("supply_quantisation", (step_V,))).parts[0].form
    best = scan_any(problem(record), Hypothesis(), form, floor_um)[0]
    assert best.values[0] == pytest.approx(step_V, rel=2e-3)


NOISE_UM = 0.05


def bench_with(effect: str, **parameters: Any) -> tuple[FitProblem, Form]:
    """A record of levels from a paper bench with the effect, and the effect's first form."""
    plain = record_of(voltage_V=levels(40.0))
    drive = Drive.of_rows(plain.time_s, plain.voltage_V)
    read_um = Simulator(drive).run(PAPER.with_block(effect, **parameters)).reading_um
    read_um += NOISE_UM * np.random.default_rng(3).standard_normal(read_um.size)
    problem = problem_of(PAPER, (observe(Record(plain.time_s, plain.voltage_V, read_um)),))
    return problem, next(x for x in candidate_forms(PAPER, problem.observations) if x.effect == effect)


@pytest.mark.parametrize(
    ("effect", "name", "size"),
    few_rows(
        [
            ("transport_delay", "delay_s", 1e-4),
            ("sensor_lag", "time_constant_s", 1e-4),
            ("source_resistance", "time_constant_s", 1e-4),
            ("supply_fall_lag", "time_constant_s", 1.5e-4),
            ("slew_limit", "slew_rate_V_per_s", 1.5e5),
            ("stiffening", "cubic_1_per_um2", -1e-6),
        ],
        0,
    ),
)
def test_an_effect_below_its_smallest_start_is_found(effect: str, name: str, size: float) -> None:
    problem, form = bench_with(effect, **{name: size})
    given = [abs(x) for x in form.free[0].starts] or [5e-4]
    assert not min(given) <= abs(size) <= max(given)
    starts = scan_any(problem, Hypothesis(), form, NOISE_UM)
    found = min(
        (x for x in (fit(problem, Hypothesis().plus(form, start.values)) for start in starts) if x is not None),
        key=lambda x: x.training_square,
    )
    assert found.hypothesis.parts[0].values[0] == pytest.approx(size, rel=0.15)


def test_a_scan_stays_among_the_starts_where_what_is_left_is_larger_than_they_do() -> None:
    problem, form = bench_with("sensor_lag", time_constant_s=0.2)
    starts = scan_any(problem, Hypothesis(), form, NOISE_UM, keep=100)
    assert sorted(x.values[0] for x in starts) == pytest.approx(sorted(form.free[0].starts))


@pytest.mark.parametrize(("vanishes_at", "low", "high"), [(None, 0.5, 18.0), (0.0, 1e-3, 18.0), (math.inf, 0.5, 9e3)])
def test_a_scale_has_room_towards_the_value_at_which_its_effect_vanishes(
    vanishes_at: float | None, low: float, high: float
) -> None:
    free = scale("any", 1.0, 9.0, 3, vanishes_at)
    assert (free.low, free.high) == pytest.approx((low, high))
    assert free.starts == pytest.approx((1.0, 3.0, 9.0))
    assert FAINTEST == 1e3


@pytest.mark.parametrize("starts", [(), (5.0,), (5.0, 5.0), (4.0, 5.0), (0.5, 1.5, 1.5)])
@pytest.mark.parametrize("vanishes_at", [0.0, 1.0, math.inf])
def test_a_scan_of_a_perfect_model_ends(vanishes_at: float, starts: tuple[float, ...]) -> None:
    """Nothing is left, so no effect is smaller: also from one start, or from two that are the same."""
    plain = record_of(voltage_V=levels(4.0))
    read_um = Simulator(Drive.of_rows(plain.time_s, plain.voltage_V)).run(PAPER).reading_um
    problem = problem_of(PAPER, (observe(Record(plain.time_s, plain.voltage_V, read_um)),))
    free = Free("frequency_ratio", 1e-9, 1e9, True, starts, vanishes_at=vanishes_at)
    form = simple("tip_mass", free)
    found = scan_any(problem, Hypothesis(), form, NOISE_UM, keep=1000)
    assert {x.values[0] for x in found} >= {x for x in starts if 0.3 < x < 10.0}
    assert len(found) < 40
    if vanishes_at == 1.0 and starts:
        nearest = min(abs(x.values[0] - 1.0) for x in found)
        assert nearest <= min(abs(x - 1.0) for x in starts) / FAINTEST * (1.0 + 1e-6)


QUIET_um = 0.02
ROWS = 6_000


@pytest.mark.parametrize(("frequency_Hz", "late_s"), [(276.8, 0.0), (276.8, 1e-4), (483.0, 0.0), (733.0, 0.0)])
def test_a_faint_mode_between_two_starts_is_found(frequency_Hz: float, late_s: float) -> None:
    time_s = np.arange(ROWS) / 4_000.0
    volts = np.random.default_rng(5).uniform(0.0, 50.0, size=ROWS // 60).repeat(60)
    plant = PAPER.with_block("second_mode", share=0.01, frequency_Hz=frequency_Hz, damping_ratio=0.005)
    reading_um = Simulator(Drive.of_rows(time_s, volts, time_s + late_s)).run(plant).reading_um
    reading_um += QUIET_um * np.random.default_rng(6).standard_normal(ROWS)
    record = Record(time_s, volts, reading_um, command_time_s=time_s + late_s)
    problem = problem_of(PAPER, (observe(record),))
    form = next(x for x in candidate_forms(PAPER, problem.observations) if x.effect == "second_mode")
    assert min(abs(x / frequency_Hz - 1.0) for x in form.free[1].starts) > 0.1
    best = scan_any(problem, Hypothesis(), form, QUIET_um)[0]
    assert best.values[1] == pytest.approx(frequency_Hz, rel=0.01)
    assert best.values[0] == pytest.approx(0.01, rel=0.5)


def test_uneven_rows_leave_the_starts_as_they_are() -> None:
    rng = np.random.default_rng(5)
    time_s = (np.arange(ROWS) + rng.uniform(0.0, 0.4, size=ROWS)) / 4_000.0
    volts = rng.uniform(0.0, 50.0, size=ROWS // 60).repeat(60)
    reading_um = Simulator(Drive.of_rows(time_s, volts)).run(PAPER).reading_um + QUIET_um * rng.standard_normal(ROWS)
    problem = problem_of(PAPER, (observe(Record(time_s, volts, reading_um)),))
    form = next(x for x in candidate_forms(PAPER, problem.observations) if x.effect == "second_mode")
    starts = scan_any(problem, Hypothesis(), form, QUIET_um, keep=100)
    assert starts
    assert {x.values[1] for x in starts} <= set(form.free[1].starts)


@pytest.mark.parametrize(("side", "part"), [("above", 0.62), ("above", 0.9), ("below", 0.75)])
@pytest.mark.parametrize("size", [0.3, 13.0])
def test_a_limit_is_found_wherever_the_output_moves(side: str, part: float, size: float) -> None:
    """The gain of the model is another one than the reading's, and the motion is far from rest: strokes say nothing."""
    rng = np.random.default_rng(7)
    sign = 1.0 if side == "above" else -1.0
    volts = sign * (3.0 + np.repeat(rng.uniform(-2.0, 2.0, 40), 30))
    time_s = np.arange(volts.size) / 30.0
    true = Structure(lags=1).model((0.4,))
    plain = Simulator(observe(Record(time_s, volts, volts)).drive, coarser=1.0).run(true).reading_um
    level = part * float(np.max(sign * plain))
    cut = sign * np.minimum(sign * plain, level)
    read = 5.0 + cut + 0.01 * rng.standard_normal(volts.size)
    base = true.with_block("linear_transduction", sensitivity_um_per_V=size)
    problem = problem_of(base, (observe(Record(time_s, volts, read)),))
    form = next(x for x in candidate_forms(base, problem.observations) if x.name == f"limit {side}")
    start = scan_any(problem, Hypothesis(), form, 0.01, 1)[0]
    ratio = size / next(x.parameters.sensitivity_um_per_V for x in true.blocks if x.id == "linear_transduction")
    assert start.values[0] == pytest.approx(ratio * level, rel=0.05)
