"""How well another effect, in its simplest form, mimics a reading: the test that a record is truly ambiguous."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from bender_proving.chain import readings_um
from bender_proving.records.excitation import Excitation
from bender_proving.cases.hidden import Hidden, Values
from bender_proving.cases.nominal import FULL_STROKE_UM, FULL_VOLTAGE_V
from bender_proving.physics.lobatto import Array
from bender_proving.cases.residual import left_over, left_over_um


@dataclass(frozen=True, slots=True)
class Simple:
    """An effect in one form with few numbers.

    Attributes:
        form: of the effect.
        parameters: (point of the box, length of the record in s) -> parameters of the form.
        low: lowest corner of the box.
        high: highest corner.
        starts: points from which to look for the best one.
    """

    form: str
    parameters: Callable[[Array, float], Values]
    low: tuple[float, ...]
    high: tuple[float, ...]
    starts: tuple[tuple[float, ...], ...]


def _lag(x: Array, _span_s: float) -> Values:
    return {"tau_s": float(np.exp(x[0])), "second_tau_s": 0.0}


def _delay(x: Array, _span_s: float) -> Values:
    return {"command_s": float(np.exp(x[0])), "reading_s": 0.0}


def _creep(x: Array, _span_s: float) -> Values:
    return {"growth": float(x[0]), "tau_s": float(np.exp(x[1]))}


def _leakage(x: Array, _span_s: float) -> Values:
    return {"fraction": float(x[0]), "tau_s": float(np.exp(x[1]))}


def _drift(x: Array, span_s: float) -> Values:
    return {"change_um": float(x[0]), "tau_s": float(np.exp(x[1])), "span_s": span_s}


def _damping(x: Array, _span_s: float) -> Values:
    return {"damping_ratio": float(np.exp(x[0])), "drag_per_um": 0.0}


def _square(x: Array, _span_s: float) -> Values:
    return {"c_um_per_V2": float(x[0]) * FULL_STROKE_UM / FULL_VOLTAGE_V**2, "bend_per_V2": 0.0}


def _saturation(x: Array, _span_s: float) -> Values:
    return {"scale_V": FULL_VOLTAGE_V * float(np.exp(x[0]))}


def _tilt(x: Array, _span_s: float) -> Values:
    return {"strength": float(x[0]) / FULL_STROKE_UM, "centre_um": 0.0}


_SLOW = ((0.02, 1.0), (0.1, 3.0))
SIMPLE: dict[str, Simple] = {
    "source_resistance": Simple("lumped", _lag, (-8.0,), (1.0,), ((-4.0,), (-1.5,))),
    "sensor_lag": Simple("one_pole", _lag, (-8.0,), (1.0,), ((-4.0,), (-1.5,))),
    "transport_delay": Simple("command", _delay, (-8.0,), (-1.0,), ((-5.0,), (-3.5,), (-2.5,))),
    "creep": Simple("one_unit", _creep, (0.0, -2.0), (0.8, 6.0), _SLOW),
    "charge_leakage": Simple("one_path", _leakage, (0.0, -1.0), (0.8, 6.0), _SLOW),
    "thermal_drift": Simple("exponential", _drift, (-20.0, 0.0), (20.0, 7.0), ((1.0, 2.0), (-1.0, 3.0))),
    "structural_damping": Simple("viscous", _damping, (-7.0,), (0.0,), ((-5.0,), (-2.0,))),
    "electrostriction": Simple("quadratic_bending", _square, (-0.8,), (0.8,), ((0.01,),)),
    "saturation": Simple("arctangent", _saturation, (-1.0,), (3.0,), ((1.0,),)),
    "lens_distortion": Simple("tilted", _tilt, (-0.5,), (0.8,), ((0.01,),)),
}


def mimicked_um(rival_id: str, reading_um: Array, plan: Excitation, enough_um: float = 0.0) -> float:
    """Rms that the rival's best fit, with gain and offset, leaves of a reading without noise.

    The search ends early once no more than `enough_um` is left.
    """
    rival = SIMPLE[rival_id]

    def model(x: Array) -> Array:
        hidden = Hidden(rival_id, rival.form, 0.0, tuple(rival.parameters(x, plan.setting.duration_s).items()))
        return readings_um(plan.commands, (hidden,))[plan.recorded]

    def misfit(x: Array) -> Array:
        return left_over(reading_um, model(x))

    best_um = np.inf
    for start in rival.starts:
        fit = least_squares(misfit, start, bounds=(rival.low, rival.high), x_scale=0.1, max_nfev=20)
        best_um = min(best_um, left_over_um(reading_um, model(fit.x)))
        if best_um <= enough_um:
            break
    return float(best_um)
