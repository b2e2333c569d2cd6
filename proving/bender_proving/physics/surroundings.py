"""The surroundings: what time alone adds to the tip or takes from it. No two records share the numbers here."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import erf

from bender_proving.cases.hidden import NOISE_UM, Ask, Effect, Hidden, Values
from bender_proving.physics.lobatto import Array

_PERIODS = 3.0


def _draw_drift(ask: Ask) -> Values:
    tau_s = ask.setting.duration_s * ask.log_uniform(0.12, 0.8)
    return {"change_um": ask.size, "tau_s": tau_s, "span_s": ask.setting.duration_s}


def _draw_disturbance(ask: Ask) -> Values:
    frequency_Hz = _visible_frequency(ask)
    overtone = (
        0.0 if ask.form == "sine" else min(ask.uniform(0.005, 0.02), 0.4 * NOISE_UM[ask.setting.sensor] / ask.size)
    )
    phase = ask.uniform(0.0, 2.0 * math.pi)
    return {"amplitude_um": ask.size, "frequency_Hz": frequency_Hz, "phase_rad": phase, "overtone": overtone}


def _visible_frequency(ask: Ask) -> float:
    """A frequency whose image in the record shows some periods; its overtone too."""
    rate_Hz = ask.setting.rate_Hz
    slowest_Hz = _PERIODS / ask.setting.duration_s
    fastest_Hz = 8.0 * rate_Hz if ask.setting.sensor == "camera" else 0.375 * rate_Hz
    while True:
        frequency_Hz = ask.log_uniform(slowest_Hz, fastest_Hz)
        image_Hz = abs(frequency_Hz - rate_Hz * round(frequency_Hz / rate_Hz))
        if slowest_Hz <= image_Hz <= 0.5 * rate_Hz - slowest_Hz:
            return frequency_Hz


def _draw_ageing(ask: Ask) -> Values:
    tau_s = ask.setting.duration_s * ask.log_uniform(0.1, 1.0)
    return {"faded": ask.size, "tau_s": tau_s, "span_s": ask.setting.duration_s}


EFFECTS = (
    Effect(
        "thermal_drift", "surroundings", "change over the record", "um", {"camera": (0.2, 10.0)}, True,
        ("exponential", "tanh", "erf"), _draw_drift,
    ),
    Effect(
        "periodic_disturbance", "surroundings", "amplitude", "um", {"camera": (0.05, 5.0), "vibrometer": (0.05, 5.0)},
        False, ("sine", "sine_and_overtone"), _draw_disturbance,
    ),
    Effect(
        "ageing", "surroundings", "gain lost over the record", "1", {"camera": (0.01, 0.5)}, False,
        ("linear", "hyperbolic", "logarithmic"), _draw_ageing,
    ),
)  # fmt: skip


def fastest_rad_per_s(hidden: Hidden) -> float:
    """Angular rate that a later lag has to follow; 0 for slow effects."""
    if hidden.id != "periodic_disturbance":
        return 0.0
    return 2.0 * math.pi * hidden["frequency_Hz"] * (1.0 if hidden["overtone"] == 0.0 else 2.0)


def surround(hidden: Hidden, tip_um: Array, time_s: Array) -> Array:
    """The tip as it stands in the room, of the shape of `tip_um`; before time 0 the room is still."""
    t = np.maximum(time_s, 0.0)
    match hidden.id:
        case "thermal_drift":
            course = {"exponential": lambda x: -np.expm1(-x), "tanh": np.tanh, "erf": erf}[hidden.form]
            tau_s = hidden["tau_s"]
            return tip_um + hidden["change_um"] * course(t / tau_s) / course(hidden["span_s"] / tau_s)
        case "periodic_disturbance":
            turn = 2.0 * math.pi * hidden["frequency_Hz"] * time_s + hidden["phase_rad"]
            return tip_um + hidden["amplitude_um"] * (np.sin(turn) + hidden["overtone"] * np.sin(2.0 * turn))
        case "ageing":
            return tip_um * _kept_gain(hidden, t)
    return tip_um


def standing_um(hidden: Hidden, time_s: Array, poles_s: Sequence[float] = ()) -> Array:
    """What the room does to a bench at rest, behind first-order poles, of the shape of `time_s`.

    A disturbance has gone on for long when a record begins.
    """
    standing = np.zeros_like(time_s)
    if hidden.id != "periodic_disturbance":
        return standing
    turn = 2.0 * math.pi * hidden["frequency_Hz"] * time_s + hidden["phase_rad"]
    for harmonic, share in ((1, 1.0), (2, hidden["overtone"])):
        omega = 2.0 * math.pi * hidden["frequency_Hz"] * harmonic
        passed = math.prod((1.0 / (1.0 + 1j * omega * tau_s) for tau_s in poles_s), start=1.0 + 0.0j)
        standing += hidden["amplitude_um"] * share * np.imag(passed * np.exp(1j * harmonic * turn))
    return standing


def _kept_gain(hidden: Hidden, t: Array) -> Array:
    faded, span_s, tau_s = hidden["faded"], hidden["span_s"], hidden["tau_s"]
    if hidden.form == "hyperbolic":
        return 1.0 / (1.0 + faded / (1.0 - faded) * t / span_s)
    if hidden.form == "logarithmic":
        return 1.0 - faded * np.log1p(t / tau_s) / math.log1p(span_s / tau_s)
    return 1.0 - faded * t / span_s
