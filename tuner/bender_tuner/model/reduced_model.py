"""A gain, one lag and a delay that stand for a plant in a tuning rule, from its sampled step response.

First a fit in time, k (1 + T0 s) exp(-d s) / ((1 + T1 s)(1 + T2 s)) with T1 > T2, whose step response is
y(t) = k + a exp(-(t-d)/T1) + b exp(-(t-d)/T2), k + a + b = 0. Fitted is the area under the response, because delay and
lags are areas and because ringing, which the model does not have, leaves little area.

Then the reduction rules of S. Skogestad, Simple analytic rules for model reduction and PID controller tuning, Journal
of Process Control 13 (2003) 291-309, section 2: a zero cancels against its neighbouring lag (rules T1 to T3), and of
the lags that the tuning rule cannot use, half of the largest goes to the delay and half to the lag that is kept.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bender_loop.errors import InputError
from bender_tuner.model.sampled_model import SampledModel

_ANSWERS = 8.0
"""A tuning rule asks about the first answer of a plant: so many times as long as it takes to come half of its way.
Creep that goes on behind that is slower than the loop and would hide the dead time in a longer fit."""
_GRID_LAGS = 24
_SHORTEST_LAG = 0.05
_GRID_DELAYS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
_SHOWS = 1e-3
"""Of the whole area: until then the response shows nothing but its dead time."""
_MOST_FITTED = 400
_SAME = 1.05


@dataclass(frozen=True, slots=True)
class SecondOrderFit:
    """k (1 + T0 s) exp(-d s) / ((1 + T1 s)(1 + T2 s)).

    Attributes:
        gain_um_per_V: k.
        zero_time_s: T0, negative for an inverse response.
        slow_lag_s: T1.
        fast_lag_s: T2.
        delay_s: d.
        misfit: rms of the residual over rms of the fitted area.
    """

    gain_um_per_V: float
    zero_time_s: float
    slow_lag_s: float
    fast_lag_s: float
    delay_s: float
    misfit: float


@dataclass(frozen=True, slots=True)
class ReducedModel:
    """k exp(-theta s) / (1 + tau s) of the whole sampled loop; a lag of 0 is a static plant behind a delay.

    Attributes:
        gain_um_per_V: k, effective at the loop's bandwidth: for a plant that answers at once and then relaxes it is
            the gain of the first answer, not that at rest.
        lag_s: tau.
        delay_s: theta, with 1.5 periods of sampling and hold, the frames of latency, and every lag left out.
    """

    gain_um_per_V: float
    lag_s: float
    delay_s: float


def reduce_model(model: SampledModel, latency_frames: int) -> ReducedModel:
    """The reduced model of a loop around `model`.

    A lag shorter than the rest of the delay is counted as delay: the loop cannot use it.

    Raises:
        InputError: the plant does not answer, or falls as the voltage rises.
    """
    fit = fit_second_order(model)
    waiting = (1.5 + latency_frames) * model.period_s + fit.delay_s
    gain, lags = fit.gain_um_per_V, [fit.slow_lag_s, fit.fast_lag_s]
    if fit.zero_time_s < 0.0:
        waiting -= fit.zero_time_s
    else:
        factor, lags = cancel_zero(fit.zero_time_s, fit.slow_lag_s, fit.fast_lag_s, waiting)
        gain *= factor
    lag, delay = _half_rule(lags, waiting)
    return ReducedModel(gain, lag, delay)


def fit_second_order(model: SampledModel) -> SecondOrderFit:
    """Least-squares fit to the area under the unit step response of `model` over its recorded length.

    Raises:
        InputError: the plant does not answer, or falls as the voltage rises.
    """
    samples, area = _area_under_step(model)
    scale = float(np.sqrt(np.mean(area**2)))
    if not scale > 0.0:
        raise InputError("the output does not respond to the input; check the names of input and output")
    start = _best_on_grid(samples, area)
    solution = least_squares(lambda p: _residual(p, samples, area)[0] / scale, start, xtol=1e-12)
    residual, (gain, slow_share) = _residual(solution.x, samples, area)
    if gain <= 0.0:
        raise InputError(
            f"the displacement falls as the voltage rises ({gain:.3g} µm/V at rest); swap the sign of input or output"
        )
    slow, fast, delay = (periods * model.period_s for periods in _unpacked(solution.x))
    zero = slow + slow_share / gain * (slow - fast)
    return SecondOrderFit(gain, zero, slow, fast, delay, float(np.sqrt(np.mean(residual**2))) / scale)


def cancel_zero(zero_s: float, slow_s: float, fast_s: float, delay_s: float) -> tuple[float, list[float]]:
    """Cancel (1 + zero s) against a lag; returns (factor of the gain, lags that are left).

    The neighbour is the smallest lag that is not shorter than the zero, else the longest one; a fit of a plant with one
    lag leaves a zero and a fast lag that cancel each other, so "not shorter" is meant within 5 %. Rules T1 to T3 of the
    paper; `delay_s` is the effective delay as known so far.
    """
    if zero_s == 0.0:
        return 1.0, [slow_s, fast_s]
    if _SAME * fast_s >= zero_s:
        neighbour, other = fast_s, slow_s
    else:
        neighbour, other = slow_s, fast_s
    delay = delay_s + min(other, delay_s)
    if zero_s >= neighbour:
        if neighbour >= delay:
            return zero_s / neighbour, [other]
        return max(zero_s / delay, 1.0), [other]
    if zero_s >= 5.0 * delay:
        return zero_s / neighbour, [other]
    bounded = min(neighbour, 5.0 * delay)
    return bounded / neighbour, [other, max(bounded - zero_s, 0.0)]


def _half_rule(lags: list[float], waiting_s: float) -> tuple[float, float]:
    """(lag, delay): the largest lag is kept with half of the second, the other half and the rest are delay."""
    ordered = sorted([*lags, 0.0], reverse=True)
    lag = ordered[0] + 0.5 * ordered[1]
    delay = waiting_s + 0.5 * ordered[1] + sum(ordered[2:])
    if lag < delay:
        return 0.0, waiting_s + sum(ordered)
    return lag, delay


def _area_under_step(model: SampledModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Samples 1..N and area under the unit step response up to them, in periods; thinned where N is large."""
    length = min(model.pulse_um_per_V.size, _horizon(model))
    response = model.step_response(length + 1)
    samples = np.arange(1, length + 1)
    if length > _MOST_FITTED:
        samples = np.unique(np.geomspace(1, length, _MOST_FITTED).astype(int))
    area = np.cumsum(response) - 0.5 * response
    return samples.astype(float), area[samples]


def _horizon(model: SampledModel) -> int:
    """Samples that hold the first answer, at least 20."""
    response = np.abs(model.step_response(model.pulse_um_per_V.size + 1))
    half = int(np.argmax(response >= 0.5 * response.max()))
    return max(20, math.ceil(_ANSWERS * (half + 1.0)))


def _best_on_grid(samples: NDArray[np.float64], area: NDArray[np.float64]) -> NDArray[np.float64]:
    lags = np.geomspace(_SHORTEST_LAG, 3.0 * samples[-1], _GRID_LAGS)
    dead = float(samples[int(np.argmax(np.abs(area) > _SHOWS * np.abs(area).max()))])
    delays = sorted({*_GRID_DELAYS, 0.5 * dead, dead - 1.0, dead})
    candidates = [
        np.array([math.log(slow / fast), math.log(fast), delay])
        for i, fast in enumerate(lags)
        for slow in lags[i + 1 :]
        for delay in delays
    ]
    costs = [float(np.sum(_residual(candidate, samples, area)[0] ** 2)) for candidate in candidates]
    return candidates[int(np.argmin(costs))]


def _unpacked(parameters: NDArray[np.float64]) -> tuple[float, float, float]:
    """(slow lag, fast lag, delay) in periods from (log of the lags' ratio, log of the fast one, delay)."""
    fast = math.exp(float(np.clip(parameters[1], -46.0, 46.0)))
    ratio = math.exp(min(abs(float(parameters[0])) + 1e-3, 46.0))
    return fast * ratio, fast, abs(float(parameters[2]))


def _residual(
    parameters: NDArray[np.float64], samples: NDArray[np.float64], area: NDArray[np.float64]
) -> tuple[NDArray[np.float64], tuple[float, float]]:
    """(residual, (k, a)) with the two linear parameters at their least-squares values."""
    slow, fast, delay = _unpacked(parameters)
    elapsed = np.maximum(samples - delay, 0.0)
    quick_area = -fast * np.expm1(-elapsed / fast)
    slow_area = -slow * np.expm1(-elapsed / slow)
    basis = np.column_stack((elapsed - quick_area, slow_area - quick_area))
    linear, *_ = np.linalg.lstsq(basis, area, rcond=None)
    return basis @ linear - area, (float(linear[0]), float(linear[1]))
