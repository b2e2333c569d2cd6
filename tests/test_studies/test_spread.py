"""Devices that are not what was diagnosed: drawn, seen late, and judged by how their loop ends."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from integral_controller import Integral

from bender_loop.control.references import Step
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.record import Record
from bender_native.ready import ready_plant_fmu
from bender_proving import Bench, make_case
from bender_proving.records.excitation import Excitation
from bender_studies.benchmarks.control import EFFECTS, hidden_benches
from bender_studies.control.hidden_loop import run_hidden
from bender_studies.control.spread import GAIN, RESONANCE, Late, is_unstable, off_nominal
from bender_studies.control.trial import loop_percent, reach

RATE_HZ = 30.0


@pytest.fixture(scope="module")
def like() -> Iterator[FmuPlant]:
    with closing(FmuPlant(ready_plant_fmu("paper"))) as plant:
        yield plant


def _ended(swings_um: tuple[float, float]) -> Record:
    time_s = np.arange(round(4.0 * RATE_HZ)) / RATE_HZ
    size = np.where(time_s > time_s[-1] - 1.0, swings_um[1], swings_um[0])
    return Record(time_s, np.zeros_like(time_s), 5.0 + 0.5 * size * np.sin(20.0 * time_s))


def test_only_a_swing_that_stays_is_unstable():
    assert is_unstable(_ended((4.0, 5.0)))
    assert not is_unstable(_ended((4.0, 3.0)))
    assert not is_unstable(_ended((0.1, 0.2)))


def _standing(tip_um: float, setpoint_um: float, approach_um: float = 0.0) -> Record:
    """A run that ends at rest, or on the way to there with a time constant of 1 s."""
    time_s = np.arange(round(4.0 * RATE_HZ)) / RATE_HZ
    tips = tip_um + approach_um * np.exp(-time_s)
    return Record(time_s, np.zeros_like(time_s), tips, setpoint_um=np.full_like(time_s, setpoint_um))


def test_a_run_that_stands_away_from_a_setpoint_within_reach_is_unstable():
    assert is_unstable(_standing(2.0, 14.0), (1.0, 20.0))
    assert is_unstable(_standing(27.0, 14.0), (1.0, 20.0))
    assert not is_unstable(_standing(12.0, 14.0), (1.0, 13.0)), "out of reach"
    assert not is_unstable(_standing(13.5, 14.0), (1.0, 20.0)), "near enough"
    assert not is_unstable(_standing(14.0, 14.0, approach_um=-40.0), (1.0, 20.0)), "on the way"


def test_a_loop_that_sticks_at_a_limit_is_unstable(like: FmuPlant):
    """Of the wrong sign, the integral ends at a limit."""
    case = make_case("single", ("creep",), 3, sensor="camera")
    assert reach(case)[0] < 10.0 < reach(case)[1]
    found = run_hidden(case, Integral(-1.0), Step(10.0), RATE_HZ, 6.0, None, like)
    assert is_unstable(found, reach(case))
    assert not is_unstable(run_hidden(case, Integral(0.1), Step(10.0), RATE_HZ, 6.0, None, like), reach(case))


def test_reach_is_what_the_voltages_lead_to():
    case = make_case("single", ("saturation",), 3, sensor="camera")
    low, high = reach(case)
    half = reach(replace(case, gain=0.5 * case.gain))
    assert 0.0 < low < high
    assert half[1] == pytest.approx(0.5 * high, rel=0.1)


def test_a_loop_past_its_margin_is_unstable_and_one_within_is_not(like: FmuPlant):
    """u[k] = u[k-1] - k g u[k-2] is stable below k g = 1: with g near 0.4 um/V, one later frame bears 2.5 V/um."""
    case = make_case("single", ("creep",), 3, sensor="camera")
    for gain_V_per_um, expected in ((1.0, False), (3.5, True)):
        found = run_hidden(case, Late(Integral(gain_V_per_um)), Step(10.0), RATE_HZ, 6.0, None, like)
        assert is_unstable(found) is expected


def test_others_differ_from_the_device_as_said():
    case = make_case("single", ("creep",), 5, sensor="camera")
    others = list(off_nominal(case, 40))
    factors = [x.gain / case.gain for x in others]
    ratios = [x.effects[-1]["frequency_ratio"] for x in others]
    for found, (low, high) in ((factors, GAIN), (ratios, RESONANCE)):
        assert low <= min(found) < low + 0.1
        assert high - 0.1 < max(found) <= high
    time_s = np.arange(20) / RATE_HZ
    plan = Excitation("camera", time_s, np.full(20, 25.0))
    own, other = (Bench(x).clean(plan) - case.offset_um for x in (case, others[0]))
    assert np.ptp(other) > 0.5 * factors[0] * np.ptp(own)
    assert list(off_nominal(case, 40)) == others


def test_what_is_left_of_a_loop_is_the_gap_between_its_two_ways():
    time_s = np.arange(round(10.0 * RATE_HZ)) / RATE_HZ
    phase = (time_s / 5.0) % 1.0
    asked_um = 2.0 + 8.0 * (1.0 - np.abs(2.0 * phase - 1.0))
    tip_um = 1.05 * asked_um + np.where(phase < 0.5, -0.1, 0.1)
    record = Record(time_s, 0.0 * time_s, tip_um, setpoint_um=asked_um)
    assert loop_percent(record, 5.0) == pytest.approx(100.0 * 0.2 / 8.0, abs=0.1)


@pytest.mark.slow
def test_the_first_benches_hide_every_effect_alone_and_most_of_them_in_pairs():
    benches = list(islice(hidden_benches(EFFECTS, 66001), 2 * len(EFFECTS)))
    assert {x.effect_ids for x in benches if len(x.effects) == 1} == {(name,) for name in EFFECTS}
    pairs = [x.effect_ids for x in benches if len(x.effects) == 2]
    assert len(pairs) == len(EFFECTS)
    assert len({name for pair in pairs for name in pair}) >= 6
