"""SIMC gains in closed form, and the first guess of a search.

S. Skogestad, Journal of Process Control 13 (2003) 291-309: Kc = tau / (k (tau_c + theta)) and
Ti = min(tau, 4 (tau_c + theta)); for a static plant behind a delay the limit tau -> 0, which is pure integral action,
Ki = 1 / (k (tau_c + theta)). The choice tau_c = theta gives tight control with Ms about 1.6.
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
    speed_s = _speed(model, closed_loop_time_s)
    scale, longest = model.gain_um_per_V * speed_s, 4.0 * speed_s
    return Gains(
        proportional_V_per_um=model.lag_s / scale,
        # finite also where Ti and Kc vanish together
        integral_V_per_um_s=1.0 / scale if model.lag_s <= longest else model.lag_s / (scale * longest),
        filter_time_s=filter_time_s,
    )


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
