"""Delays, modes and slow swings that a record of frames on a grid shows only in part: which of them may be named."""

import math
from dataclasses import replace

import numpy as np
import pytest
from reported_diagnosis import NOISE_um, levels, record_of

from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.effects.effect import Sizes
from bender_discrepancy.fitting.fit_problem import problem_of
from bender_discrepancy.fitting.hypothesis import Hypothesis, Part
from bender_discrepancy.fitting.scans.delay import scan_delay
from bender_discrepancy.records.observations import observe
from bender_discrepancy.workflow import candidate_forms
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
