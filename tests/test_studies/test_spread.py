"""Devices that are not what was diagnosed: drawn, seen late, and judged by how their loop ends."""

from dataclasses import dataclass

import numpy as np

from bender_loop.control.references import Step
from bender_loop.records.record import Record
from bender_proving import Bench, make_case
from bender_proving.records.excitation import Excitation
from bender_studies.control.hidden_loop import run_hidden
from bender_studies.control.spread import GAIN, RESONANCE, Late, is_unstable, off_nominal

RATE_HZ = 30.0


@dataclass(frozen=True)
class Integral:
    """A controller that integrates, between 0 and 50 V."""

    gain_V_per_um: float

    def rest(self) -> float:
        return 0.0

    def step(self, state: float, time_s: float, reading_um: float) -> tuple[float, float]:
        after = min(max(state + self.gain_V_per_um * (10.0 - reading_um), 0.0), 50.0)
        return after, after


def _ended(swings_um: tuple[float, float]) -> Record:
    time_s = np.arange(round(4.0 * RATE_HZ)) / RATE_HZ
    size = np.where(time_s > time_s[-1] - 1.0, swings_um[1], swings_um[0])
    return Record(time_s, np.zeros_like(time_s), 5.0 + 0.5 * size * np.sin(20.0 * time_s))


def test_only_a_swing_that_stays_is_unstable():
    assert is_unstable(_ended((4.0, 5.0)))
    assert not is_unstable(_ended((4.0, 3.0)))
    assert not is_unstable(_ended((0.1, 0.2)))


def test_a_loop_past_its_margin_is_unstable_and_one_within_is_not():
    """u[k] = u[k-1] - k g u[k-2] is stable below k g = 1: with g near 0.4 um/V, one later frame bears 2.5 V/um."""
    case = make_case("single", ("creep",), 3, sensor="camera")
    for gain_V_per_um, expected in ((1.0, False), (3.5, True)):
        found = run_hidden(case, Late(Integral(gain_V_per_um)), Step(10.0), RATE_HZ, 6.0, seed=None)
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
