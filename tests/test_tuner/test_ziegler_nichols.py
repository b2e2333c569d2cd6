"""Ziegler and Nichols' rule, and when it says that it does not apply."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq

from bender_loop.control.pid import Limits
from bender_loop.control.plant import Plant
from bender_loop.control.sampling import Sampling
from bender_tuner.model.linear_model import Linearisation, OperatingPoint, linearise_at
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.sampled_model import SampledModel
from bender_tuner.model.ultimate import RelayTest, UltimatePoint, linear_ultimate_point, relay_ultimate_point
from bender_tuner.rules.ziegler_nichols import Rule, Verdict, rule_gains, ziegler_nichols

PERIOD = 0.02
LIMITS = Limits(0.0, 50.0)

# 1/(s + 1)^3 behind half a period of hold: 3 atan(w) + 0.01 w = pi, Ku = (1 + w^2)^1.5 (8 at sqrt(3) without the hold)
CUBIC = ([1.0], [1.0, 3.0, 3.0, 1.0])
CUBIC_OMEGA = float(brentq(lambda w: 3.0 * math.atan(w) + 0.01 * w - math.pi, 1.0, 2.0))  # pyright: ignore
CUBIC_GAIN = (1.0 + CUBIC_OMEGA**2) ** 1.5
CUBIC_PERIOD_S = 2.0 * math.pi / CUBIC_OMEGA


@pytest.fixture(scope="module")
def cubic(linear_plant: Callable[..., Plant]) -> tuple[Plant, Linearisation, Sampling]:
    plant, sampling = linear_plant(*CUBIC), Sampling(50.0)
    return plant, linearise_at(plant, 10.0, sampling, LIMITS), sampling


def test_ultimate_point_of_a_third_order_lag(cubic: tuple[Plant, Linearisation, Sampling]) -> None:
    plant, linearisation, sampling = cubic
    linear = linear_ultimate_point(DelayedPlant(linearisation.model))
    relay = relay_ultimate_point(plant, linearisation.point, sampling, RelayTest(2.0, longest_frames=2500))
    assert linear is not None
    assert relay is not None
    assert linear.gain_V_per_um == pytest.approx(CUBIC_GAIN, rel=2e-3)
    assert linear.period_s == pytest.approx(CUBIC_PERIOD_S, rel=2e-3)
    assert relay.gain_V_per_um == pytest.approx(CUBIC_GAIN, rel=0.06)
    assert relay.period_s == pytest.approx(CUBIC_PERIOD_S, rel=0.03)


def test_a_well_posed_loop_gets_the_table(cubic: tuple[Plant, Linearisation, Sampling]) -> None:
    plant, linearisation, sampling = cubic
    found = ziegler_nichols(plant, linearisation, sampling, RelayTest(2.0, longest_frames=2500))
    assert found.verdict is Verdict.WELL_POSED
    assert found.well_posed
    assert "the rule applies" in found.sentence
    pid = found.gains[Rule.PID]
    assert pid.proportional_V_per_um == pytest.approx(0.6 * CUBIC_GAIN, rel=2e-3)
    assert pid.proportional_V_per_um / pid.integral_V_per_um_s == pytest.approx(CUBIC_PERIOD_S / 2.0, rel=2e-3)
    assert pid.derivative_V_s_per_um / pid.proportional_V_per_um == pytest.approx(CUBIC_PERIOD_S / 8.0, rel=2e-3)


def test_hysteresis_and_bias_of_the_relay(cubic: tuple[Plant, Linearisation, Sampling]) -> None:
    plant, linearisation, sampling = cubic
    # hysteresis moves the point to a lower frequency and a larger amplitude
    plain, hysteretic, biased = (
        relay_ultimate_point(plant, linearisation.point, sampling, RelayTest(2.0, h, b, 2500))
        for h, b in ((0.0, 0.0), (0.1, 0.0), (0.0, 0.3))
    )
    assert plain is not None
    assert hysteretic is not None
    assert biased is not None
    assert hysteretic.period_s > 1.05 * plain.period_s
    assert biased.gain_V_per_um == pytest.approx(plain.gain_V_per_um, rel=0.1)


def test_relay_amplitude_does_not_matter_on_a_linear_plant(cubic: tuple[Plant, Linearisation, Sampling]) -> None:
    plant, linearisation, sampling = cubic
    small, large = (
        relay_ultimate_point(plant, linearisation.point, sampling, RelayTest(amplitude, longest_frames=2500))
        for amplitude in (1.0, 4.0)
    )
    assert small is not None
    assert large is not None
    assert small.gain_V_per_um == pytest.approx(large.gain_V_per_um, rel=0.02)


def test_rule_table_by_hand() -> None:
    point = UltimatePoint(10.0, 2.0)
    assert rule_gains(Rule.P, point).proportional_V_per_um == 5.0
    assert rule_gains(Rule.P, point).integral_V_per_um_s == 0.0
    pi = rule_gains(Rule.PI, point)
    assert (pi.proportional_V_per_um, pi.integral_V_per_um_s) == pytest.approx((4.5, 4.5 / (2.0 / 1.2)))
    pid = rule_gains(Rule.PID, point, filter_time_s=0.1)
    assert (pid.proportional_V_per_um, pid.integral_V_per_um_s) == pytest.approx((6.0, 6.0))
    assert (pid.derivative_V_s_per_um, pid.filter_time_s) == pytest.approx((1.5, 0.1))


def test_the_learned_hysteresis_at_30_hz_has_an_artefact(relaxing_plant: Callable[[], Plant]) -> None:
    plant, sampling = relaxing_plant(), Sampling(30.0)
    found = ziegler_nichols(plant, linearise_at(plant, 10.0, sampling, LIMITS), sampling, RelayTest(3.0))
    assert found.verdict is Verdict.SAMPLING_ARTEFACT
    assert not found.well_posed
    assert "2.0 samples, fewer than 4" in found.sentence
    assert found.linear is not None
    assert found.linear.period_s == pytest.approx(2.0 / 30.0)
    assert set(found.gains) == set(Rule)


def test_one_frame_late_the_table_is_unstable(relaxing_plant: Callable[[], Plant]) -> None:
    plant, sampling = relaxing_plant(), Sampling(30.0, 1)
    found = ziegler_nichols(plant, linearise_at(plant, 10.0, sampling, LIMITS), sampling, RelayTest(3.0))
    assert found.linear is not None
    assert found.linear.gain_V_per_um == pytest.approx(1.52, rel=0.02)
    assert found.relay is not None
    assert found.relay.gain_V_per_um / found.linear.gain_V_per_um == pytest.approx(1.12, abs=0.05)
    assert found.verdict in (Verdict.WELL_POSED, Verdict.TUNED_LOOP_UNSTABLE)


def test_disagreement_silence_and_nothing_to_start_from(
    cubic: tuple[Plant, Linearisation, Sampling], linear_plant: Callable[..., Plant]
) -> None:
    plant, linearisation, sampling = cubic
    other = linear_plant([2.0], CUBIC[1])
    relay = RelayTest(2.0, longest_frames=2500)
    settled = Linearisation(OperatingPoint(5.0, 10.0, 500, True), linearisation.model)
    assert ziegler_nichols(other, settled, sampling, relay).verdict is Verdict.RELAY_DISAGREES
    silent = ziegler_nichols(plant, linearisation, sampling, RelayTest(2.0, hysteresis_um=5.0, longest_frames=300))
    assert silent.verdict is Verdict.RELAY_SILENT
    assert silent.relay is None
    dead = Linearisation(linearisation.point, SampledModel(PERIOD, np.zeros(20)))
    nothing = ziegler_nichols(plant, dead, sampling, None)
    assert nothing.verdict is Verdict.NO_ULTIMATE_GAIN
    assert not nothing.gains
    assert ziegler_nichols(plant, linearisation, sampling, None).well_posed


@pytest.mark.parametrize(
    "values", [(0.0, 0.0, 0.0, 600), (1.0, -1.0, 0.0, 600), (1.0, 0.0, math.nan, 600), (1.0, 0.0, 0.0, 2)]
)
def test_relay_settings_are_checked(values: tuple[float, float, float, int]) -> None:
    with pytest.raises(ValueError, match="must be"):
        RelayTest(*values)
