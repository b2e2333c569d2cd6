"""The demonstration's runs on the bench: every step is told, and what became worse is said."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lsim

from bender_loop.control.metrics import has_settled
from bender_loop.records.record import Record
from bender_report.page import Link, Page, Section, render
from bender_studies.demonstration.bench import (
    DURATION_S,
    SETPOINTS_UM,
    STEPS_S,
    dead_time_rms_um,
    setpoint_at,
    step_figures,
)
from bender_studies.demonstration.bench_story import Compared, compared

RATE_HZ = 30.0


def lagging(tau_s: float) -> Record:
    """A run whose tip follows the set-point with one time constant."""
    time_s = np.arange(0.0, DURATION_S, 1.0 / RATE_HZ)
    tip_um = np.zeros_like(time_s)
    for begin_s, low, high in zip(STEPS_S[1:], SETPOINTS_UM, SETPOINTS_UM[1:], strict=False):
        tip_um += np.where(time_s >= begin_s, (high - low) * -np.expm1(-np.maximum(time_s - begin_s, 0.0) / tau_s), 0.0)
    return Record(time_s, setpoint_at(time_s), tip_um)


def ringing(frequency: float, damping: float) -> Record:
    """A run whose tip is that of a damped oscillator, computed by another way."""
    time_s = np.arange(0.0, DURATION_S, 1.0 / RATE_HZ)
    system = ([frequency**2], [1.0, 2.0 * damping * frequency, frequency**2])
    _, tip_um, _ = lsim(system, setpoint_at(time_s), time_s)
    return Record(time_s, setpoint_at(time_s), np.asarray(tip_um))


def test_each_step_has_the_figures_of_its_own_time() -> None:
    tau_s = 0.3
    found = step_figures(lagging(tau_s))
    assert [(x.from_um, x.to_um, x.seen_s) for x in found] == [(0.0, 10.0, 4.0), (10.0, 4.0, 3.0), (4.0, 14.0, 3.5)]
    for x in found:
        assert x.overshoot_percent == pytest.approx(0.0, abs=1e-3)
        assert x.settling_time_s == pytest.approx(tau_s * math.log(50.0), abs=1.5 / RATE_HZ)
        exact = abs(x.to_um - x.from_um) * math.sqrt(0.5 * tau_s / x.seen_s)
        assert x.rms_um == pytest.approx(exact, rel=0.1)


@pytest.mark.parametrize(("late_s", "frames"), [(None, 4), (0.01, 4), (0.02, 5)])
def test_what_a_dead_time_costs_counts_from_when_the_commands_act(late_s: float | None, frames: int) -> None:
    time_s = np.arange(330) / RATE_HZ
    acting_s = None if late_s is None else time_s + late_s
    record = Record(time_s, np.zeros(330), np.zeros(330), command_time_s=acting_s)
    steps_um = np.diff(SETPOINTS_UM)
    expected = math.sqrt(frames * float(np.sum(steps_um**2)) / 330)
    assert dead_time_rms_um(record, 0.12) == pytest.approx(expected, rel=1e-12)


def test_a_step_that_does_not_settle_before_the_next_says_so() -> None:
    figures = compared(lagging(0.2), lagging(3.0))
    settling = [x for x in figures if x.what.startswith("settling")]
    assert [x.cells[2] for x in settling] == ["not within 4 s", "not within 3 s", "not within 3.5 s"]
    assert [x.verdict for x in settling] == ["worse"] * 3


@pytest.mark.parametrize(
    ("before", "after", "verdict"),
    [(1.0, 0.9, "better"), (0.9, 1.0, "worse"), (1.01, 0.99, "the same"), (math.nan, 3.0, "better"),
     (3.0, math.nan, "worse"), (math.nan, math.nan, "the same")],
)  # fmt: skip
def test_the_verdict_is_that_of_the_digits_shown(before: float, after: float, verdict: str) -> None:
    assert Compared("step 1", "overshoot (%)", before, after, 1).verdict == verdict


@pytest.mark.parametrize(("settling_s", "said"), [(0.8, True), (1.9, True), (1.97, False), (math.nan, False)])
def test_the_end_of_a_run_is_no_settling_time(settling_s: float, said: bool) -> None:
    assert has_settled(settling_s, 2.0) is said


def test_a_page_links_what_lies_beside_it(tmp_path: Path) -> None:
    page = tmp_path / "index.html"
    page.write_text(
        render(Page("t", "", [], [Section("h", links=[Link("the <report>", 'a/"b.html')])])), encoding="utf-8"
    )
    assert '<a href="a/&#34;b.html">the &lt;report&gt;</a>' in page.read_text(encoding="utf-8")
