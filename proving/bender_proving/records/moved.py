"""Forms moved away from every equation: what no form of an effect has, smooth in the state of the bench.

The part that is added depends on the voltage, on what the effect does and on a slow memory of the voltage, through
random Fourier features (Rahimi and Recht, NIPS 2007) of about one bend over their range. What gain, offset and the
strength of the effect could take up is taken out of it.
"""

import numpy as np
from bender_proving.cases.nominal import FULL_VOLTAGE_V
from bender_proving.cases.residual import left_over_um
from bender_proving.physics.lobatto import Array
from bender_proving.records.excitation import Excitation
from numpy.random import Generator
from scipy.signal import lfilter

_FEATURES = 24
_NOTHING = 1e-12
_BENDS = 0.6
_MEMORY = (0.003, 0.05)


def moved_um(reading_um: Array, nominal_um: Array, plan: Excitation, rng: Generator) -> Array:
    """Return what moves a reading, of the size of the effect itself (rms, recalibrated), shape of the recorded rows."""
    effect_um = reading_um - nominal_um
    size_um = left_over_um(reading_um, nominal_um)
    if size_um <= _NOTHING * float(np.ptp(nominal_um)):
        return np.zeros_like(reading_um)
    volts = plan.voltage_V / FULL_VOLTAGE_V
    duration_s = float(plan.time_s[-1] - plan.time_s[0])
    kept = np.exp(-duration_s / len(volts) / (duration_s * rng.uniform(*_MEMORY)))
    slow = np.asarray(lfilter([1.0 - kept], [1.0, -kept], volts))
    state = np.column_stack([volts[plan.recorded], slow[plan.recorded], effect_um / (3.0 * size_um)])
    waves = rng.normal(0.0, 2.0 * np.pi * _BENDS, (3, _FEATURES))
    course = np.cos(state @ waves + rng.uniform(0.0, 2.0 * np.pi, _FEATURES)) @ rng.normal(0.0, 1.0, _FEATURES)
    known = np.column_stack([np.ones_like(reading_um), nominal_um, effect_um])
    course -= known @ np.linalg.lstsq(known, course, rcond=None)[0]
    return size_um * course / float(np.sqrt(np.mean(course**2)))
