"""SIMC and improved SIMC gains in closed form, and the first guess of a search.

S. Skogestad, Journal of Process Control 13 (2003) 291-309: Kc = tau / (k (tau_c + theta)) and
Ti = min(tau, 4 (tau_c + theta)); for a static plant behind a delay the limit tau -> 0, which is pure integral action,
Ki = 1 / (k (tau_c + theta)). The choice tau_c = theta gives tight control with Ms about 1.6.
C. Grimholt and S. Skogestad, Optimal PI and PID control of first-order plus delay processes and evaluation of the
original and improved SIMC rules, Journal of Process Control 70 (2018) 36-46: the same with a series derivative time
theta / 3; for the static plant its zero lands in the proportional gain.
"""

import math

from bender_loop.control.pid import Gains
from bender_tuner.model.reduced_model import ReducedModel

FILTER_PERIODS = 2.0


def simc(model: ReducedModel, *, closed_loop_time_s: float | None = None, filter_time_s: float = 0.0) -> Gains:
    """I gains for a static plant, PI gains for a lag; tau_c = theta unless `closed_loop_time_s` is given.

    Raises:
        ValueError: gain or delay of the model is not positive, or `closed_loop_time_s` is negative.
    """
    return _parallel(model, _speed(model, closed_loop_time_s), 0.0, filter_time_s)


def improved_simc(model: ReducedModel, *, closed_loop_time_s: float | None = None, filter_time_s: float = 0.0) -> Gains:
    """The rule with derivative time theta / 3: PI gains for a static plant, PID gains for a lag.

    Raises:
        ValueError: gain or delay of the model is not positive, or `closed_loop_time_s` is negative.
    """
    return _parallel(model, _speed(model, closed_loop_time_s), model.delay_s / 3.0, filter_time_s)


def first_guess(model: ReducedModel, period_s: float) -> Gains:
    """Where a search begins: Kp = 0.2/k, Ki = 1/(2 k theta), D filter of two periods, Kd = Kp Tf.

    For a plant with a lag Kp is that of SIMC, if that is larger. With Kd = Kp Tf the filtered derivative weighs as much
    as the proportional part at high frequencies: a box of some decades about it holds both a D that does nothing and
    one that rules.

    Raises:
        ValueError: gain or delay of the model is not positive.
    """
    rule = simc(model)
    proportional = max(0.2 / model.gain_um_per_V, rule.proportional_V_per_um)
    return Gains(
        proportional_V_per_um=proportional,
        integral_V_per_um_s=rule.integral_V_per_um_s,
        derivative_V_s_per_um=proportional * FILTER_PERIODS * period_s,
        filter_time_s=FILTER_PERIODS * period_s,
    )


def _speed(model: ReducedModel, closed_loop_time_s: float | None) -> float:
    """K (tau_c + theta), by which every gain is divided."""
    for name in ("gain_um_per_V", "delay_s"):
        value = getattr(model, name)
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"model.{name} must be a finite number > 0, found {value!r}")
    wanted = model.delay_s if closed_loop_time_s is None else closed_loop_time_s
    if not (math.isfinite(wanted) and wanted >= 0.0):
        raise ValueError(f"closed_loop_time_s must be a finite number >= 0, found {closed_loop_time_s!r}")
    return wanted + model.delay_s


def _parallel(model: ReducedModel, speed_s: float, derivative_time_s: float, filter_time_s: float) -> Gains:
    """The series form Kc (1 + 1/(Ti s)) (1 + Td s) multiplied out, finite also where Ti and Kc vanish together."""
    scale = model.gain_um_per_V * speed_s
    longest = 4.0 * speed_s
    integral = 1.0 / scale if model.lag_s <= longest else model.lag_s / (scale * longest)
    controller_gain = model.lag_s / scale
    return Gains(
        proportional_V_per_um=controller_gain + integral * derivative_time_s,
        integral_V_per_um_s=integral,
        derivative_V_s_per_um=controller_gain * derivative_time_s,
        filter_time_s=filter_time_s,
    )
