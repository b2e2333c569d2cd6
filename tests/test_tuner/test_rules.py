"""The rules in closed form: model reduction, SIMC, Ziegler and Nichols, and when a rule does not apply."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from bender_loop.control.pid import Limits
from bender_loop.control.plant import Plant
from bender_loop.control.sampling import Sampling
from bender_loop.errors import InputError
from bender_tuner.model.linear_model import Linearisation, OperatingPoint, linearise_at
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.margins import margins
from bender_tuner.model.reduced_model import ReducedModel, cancel_zero, fit_second_order, reduce_model
from bender_tuner.model.sampled_model import SampledModel, model_from_step
from bender_tuner.model.ultimate import RelayTest, UltimatePoint, linear_ultimate_point, relay_ultimate_point
from bender_tuner.rules.simc import first_guess, simc
from bender_tuner.rules.ziegler_nichols import Rule, Verdict, rule_gains, ziegler_nichols

PERIOD = 0.02
LIMITS = Limits(0.0, 50.0)


def first_order_step(gain: float, lag_s: float, delay_s: float, count: int = 500) -> SampledModel:
    elapsed = np.maximum(PERIOD * np.arange(count) - delay_s, 0.0)
    return model_from_step(PERIOD, gain * -np.expm1(-elapsed / lag_s))


@pytest.mark.parametrize(("lag_s", "delay_s"), [(1.0, 0.2), (1.0, 0.213), (0.3, 0.0), (0.1, 0.5)])
def test_lag_and_delay_are_found(lag_s: float, delay_s: float) -> None:
    fit = fit_second_order(first_order_step(2.0, lag_s, delay_s))
    assert fit.gain_um_per_V == pytest.approx(2.0, rel=1e-3)
    assert fit.slow_lag_s + fit.fast_lag_s + fit.delay_s - fit.zero_time_s == pytest.approx(lag_s + delay_s, rel=0.02)
    assert fit.misfit < 1e-3


@pytest.mark.parametrize(("lag_s", "delay_s"), [(1.0, 0.2), (1.0, 0.213), (0.3, 0.0)])
def test_a_lag_plant_is_reduced_to_itself(lag_s: float, delay_s: float) -> None:
    reduced = reduce_model(first_order_step(2.0, lag_s, delay_s), 2)
    assert reduced.gain_um_per_V == pytest.approx(2.0, rel=1e-3)
    assert reduced.lag_s == pytest.approx(lag_s, rel=0.02)
    assert reduced.delay_s == pytest.approx(delay_s + 3.5 * PERIOD, abs=0.3 * PERIOD)


def test_a_lag_that_the_loop_cannot_use_is_delay() -> None:
    reduced = reduce_model(first_order_step(0.8, 0.02, 0.0), 1)
    assert reduced.lag_s == 0.0
    assert reduced.delay_s == pytest.approx(0.02 + 2.5 * PERIOD, abs=0.3 * PERIOD)


@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.25])
def test_a_static_plant_is_gain_and_delay(delay_s: float) -> None:
    step = np.where(PERIOD * np.arange(200) > delay_s, 0.8, 0.0)
    reduced = reduce_model(model_from_step(PERIOD, step), 0)
    assert reduced.gain_um_per_V == pytest.approx(0.8, rel=1e-3)
    assert reduced.lag_s == 0.0
    # the samples do not tell where in its period the jump lies
    assert reduced.delay_s == pytest.approx(delay_s + 1.5 * PERIOD, abs=0.6 * PERIOD)


def test_an_integrating_plant_is_slope_and_delay() -> None:
    reduced = reduce_model(model_from_step(PERIOD, 0.3 * np.maximum(PERIOD * np.arange(300) - 0.1, 0.0)), 0)
    assert reduced.gain_um_per_V / reduced.lag_s == pytest.approx(0.3, rel=1e-3)
    # Kc = 1/(k' 2 theta), Ti = 8 theta
    gains, theta = simc(reduced), 0.1 + 1.5 * PERIOD
    assert gains.proportional_V_per_um == pytest.approx(1.0 / (0.3 * 2.0 * theta), rel=0.02)
    ratio = gains.proportional_V_per_um / gains.integral_V_per_um_s
    assert ratio == pytest.approx(8.0 * theta, rel=0.02)


def test_the_learned_hysteresis_counts_with_its_first_answer(relaxing_plant: Callable[[], Plant]) -> None:
    sampling = Sampling(30.0, 1, exposure_s=0.015, substeps=10)
    reduced = reduce_model(linearise_at(relaxing_plant(), 10.0, sampling, LIMITS).model, 1)
    assert reduced.gain_um_per_V == pytest.approx(0.818, rel=0.01)
    assert reduced.lag_s == 0.0
    assert reduced.delay_s == pytest.approx(2.5 / 30.0 + 0.020 + 0.0075, abs=0.002)


def test_an_inverse_response_is_delay() -> None:
    # (1 - 0.2 s) / (1 + s): y = 1 - 1.2 exp(-t)
    times = PERIOD * np.arange(600)
    step = np.where(times > 0.0, 1.0 - 1.2 * np.exp(-times), 0.0)
    reduced = reduce_model(model_from_step(PERIOD, step), 0)
    assert reduced.lag_s == pytest.approx(1.0, rel=0.03)
    assert reduced.delay_s == pytest.approx(0.2 + 1.5 * PERIOD, abs=0.6 * PERIOD)


def test_plants_without_a_rule_are_refused() -> None:
    with pytest.raises(InputError, match="does not respond"):
        reduce_model(SampledModel(PERIOD, np.zeros(40)), 0)
    with pytest.raises(InputError, match="falls as the voltage rises"):
        reduce_model(first_order_step(-1.0, 0.3, 0.0), 0)


@pytest.mark.parametrize(
    ("zero", "slow", "fast", "delay", "factor", "lags"),
    [
        (0.5, 0.3, 0.02, 0.08, 0.5 / 0.3, [0.02]),  # T1: zero >= lag >= delay
        (0.5, 0.05, 0.01, 0.2, 0.5 / 0.21, [0.01]),  # T1a: zero >= delay >= lag
        (0.15, 0.05, 0.01, 0.2, 1.0, [0.01]),  # T1b: delay >= zero >= lag
        (2.0, 4.0, 0.0, 0.1, 0.5, [0.0]),  # T2: lag >= zero >= 5 delay
        (0.3, 1.0, 0.0, 0.1, 0.5, [0.0, 0.2]),  # T3 with the lag bounded to 5 delay
        (0.0, 1.0, 0.2, 0.1, 1.0, [1.0, 0.2]),
    ],
)
def test_rules_for_zeros(zero: float, slow: float, fast: float, delay: float, factor: float, lags: list[float]) -> None:
    found, left = cancel_zero(zero, slow, fast, delay)
    assert found == pytest.approx(factor)
    assert left == pytest.approx(lags)


def test_simc_by_hand() -> None:
    # the 30 Hz loop: Ki = 1/(0.818 * 2 * 0.10333)
    static = simc(ReducedModel(0.818, 0.0, 0.1 + 1.0 / 300.0))
    assert static.integral_V_per_um_s == pytest.approx(5.9155, rel=1e-4)
    assert (static.proportional_V_per_um, static.derivative_V_s_per_um) == (0.0, 0.0)
    # Kc = 1/(2 * 0.4), Ti = min(1, 1.6)
    lag = simc(ReducedModel(2.0, 1.0, 0.2))
    assert lag.proportional_V_per_um == pytest.approx(1.25)
    assert lag.integral_V_per_um_s == pytest.approx(1.25)
    # Ti = 4 (tau_c + theta) = 1.6 where the lag is 10
    slow = simc(ReducedModel(2.0, 10.0, 0.2))
    assert slow.proportional_V_per_um == pytest.approx(12.5)
    assert slow.integral_V_per_um_s == pytest.approx(12.5 / 1.6)


@given(gain=st.floats(0.1, 10.0), slower=st.floats(0.1, 10.0), lag=st.one_of(st.just(0.0), st.floats(0.1, 100.0)))
def test_gains_fall_as_the_plant_gain_rises_and_a_slower_clock_scales_the_times(gain: float, slower: float, lag: float):
    one, other = simc(ReducedModel(1.0, lag, 0.1)), simc(ReducedModel(gain, slower * lag, slower * 0.1))
    assert other.proportional_V_per_um == pytest.approx(one.proportional_V_per_um / gain)
    assert other.integral_V_per_um_s == pytest.approx(one.integral_V_per_um_s / (gain * slower))


@pytest.mark.parametrize("lag_s", [0.0, 0.5, 5.0])
def test_simc_keeps_its_promise_on_ms(lag_s: float) -> None:
    # a pure delay of 10 fine periods: theta = 10.5 T of the loop itself, tau_c = theta gives Ms of 1.3 to 1.75
    fine, delay = 0.01, 10
    step = np.append(np.zeros(delay), np.arange(1, 3000) * fine)
    response = np.ones_like(step) if lag_s == 0.0 else -np.expm1(-step / lag_s)
    response[:delay] = 0.0
    model = model_from_step(fine, np.append(0.0, response))
    gains = simc(ReducedModel(1.0, lag_s, (delay + 0.5) * fine))
    found = margins(gains, DelayedPlant(model))  # pyright: ignore[reportArgumentType]
    assert 1.3 < found.sensitivity_peak < 1.75


def test_first_guess_by_hand() -> None:
    guess = first_guess(ReducedModel(0.8, 0.0, 0.1), 0.04)
    assert guess.proportional_V_per_um == pytest.approx(0.25)
    assert guess.integral_V_per_um_s == pytest.approx(6.25)
    assert guess.derivative_V_s_per_um == pytest.approx(0.02)
    assert guess.filter_time_s == pytest.approx(0.08)
    assert first_guess(ReducedModel(0.8, 5.0, 0.1), 0.04).proportional_V_per_um == pytest.approx(5.0 / 0.16)


def test_models_are_checked() -> None:
    with pytest.raises(ValueError, match=r"model\.delay_s"):
        simc(ReducedModel(1.0, 1.0, 0.0))
    with pytest.raises(ValueError, match="closed_loop_time_s"):
        simc(ReducedModel(1.0, 1.0, 0.1), closed_loop_time_s=-1.0)


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


def test_hysteresis_slows_the_relay_bias_and_amplitude_do_not_matter(
    cubic: tuple[Plant, Linearisation, Sampling],
) -> None:
    plant, linearisation, sampling = cubic
    relays = [
        RelayTest(*x, 2500)
        for x in ((2.0, 0.0, 0.0), (2.0, 0.1, 0.0), (2.0, 0.0, 0.3), (1.0, 0.0, 0.0), (4.0, 0.0, 0.0))
    ]
    found = [relay_ultimate_point(plant, linearisation.point, sampling, x) for x in relays]
    plain, hysteretic, biased, small, large = [x for x in found if x is not None]
    assert hysteretic.period_s > 1.05 * plain.period_s
    assert biased.gain_V_per_um == pytest.approx(plain.gain_V_per_um, rel=0.1)
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
