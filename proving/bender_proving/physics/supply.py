"""The supply: from the command to the electrode voltage.

CONTRACT.md gives most equations of this stage; second forms add what a real circuit adds to them, within what the
noise of the sensor hides once the equation's own number has been fitted.
"""

import math

import numpy as np
from bender_proving.cases.hidden import Ask, Effect, Hidden, Values, two_poles
from bender_proving.physics.lobatto import Array
from bender_proving.physics.segments import FALL, LAG, SLEW, Answer


def _draw_delay(ask: Ask) -> Values:
    share = {"command": 1.0, "reading": 0.0, "both": ask.uniform(0.2, 0.8)}[ask.form]
    return {"command_s": share * ask.size, "reading_s": (1.0 - share) * ask.size}


def _draw_quantisation(ask: Ask) -> Values:
    return {"step_V": ask.size}


def _draw_slew(ask: Ask) -> Values:
    widest_V = 0.15 if ask.setting.sensor == "camera" else 0.03
    landing_V = 0.0 if ask.form == "hard" else ask.log_uniform(0.1 * widest_V, widest_V)
    return {"rate_V_per_s": ask.size, "landing_s": landing_V / ask.size}


def _draw_fall(ask: Ask) -> Values:
    most_V = 0.15 if ask.setting.sensor == "camera" else 0.015
    return {"tau_s": ask.size, "bleed_V": 0.0 if ask.form == "resistor" else ask.log_uniform(0.1 * most_V, most_V)}


def _draw_source(ask: Ask) -> Values:
    return two_poles(ask) if ask.form == "ladder" else {"tau_s": ask.size, "second_tau_s": 0.0}


def _draw_dead_zone(ask: Ask) -> Values:
    return {
        "half_width_V": ask.size,
        "shoulder_V": 0.0 if ask.form == "sharp" else ask.size * ask.log_uniform(0.01, 0.05),
    }


EFFECTS = (
    Effect(
        "transport_delay", "supply", "delay", "s", {"camera": (2e-3, 0.3), "vibrometer": (0.5e-3, 0.05)}, False,
        ("command", "reading", "both"), _draw_delay,
    ),
    Effect(
        "supply_quantisation", "supply", "step", "V", {"camera": (0.02, 10.0), "vibrometer": (0.02, 10.0)}, False,
        ("half_to_even", "half_up"), _draw_quantisation,
    ),
    Effect(
        "slew_limit", "supply", "largest rate", "V/s", {"camera": (5.0, 2e3), "vibrometer": (50.0, 2e4)}, False,
        ("hard", "soft_landing"), _draw_slew,
    ),
    Effect(
        "supply_fall_lag", "supply", "time constant", "s", {"camera": (2e-3, 2.0), "vibrometer": (1e-3, 0.2)}, False,
        ("resistor", "resistor_and_bleed"), _draw_fall,
    ),
    Effect(
        "source_resistance", "supply", "time constant", "s", {"camera": (1e-3, 1.0), "vibrometer": (0.5e-3, 0.1)},
        False, ("lumped", "ladder"), _draw_source,
    ),
    Effect(
        "dead_zone", "supply", "half-width", "V", {"camera": (0.1, 10.0), "vibrometer": (0.1, 10.0)}, False,
        ("sharp", "soft_shoulder"), _draw_dead_zone,
    ),
)  # fmt: skip


def shift_commands(hidden: Hidden, act_s: Array, target_V: Array) -> tuple[Array, Array]:
    """What the effect does to when commands act and to what they ask for; one that does neither changes nothing."""
    if hidden.id == "transport_delay":
        return act_s + hidden["command_s"], target_V
    if hidden.id == "supply_quantisation":
        steps = target_V / hidden["step_V"]
        return act_s, hidden["step_V"] * (np.floor(steps + 0.5) if hidden.form == "half_up" else np.rint(steps))
    return act_s, target_V


def reading_delay_s(hidden: Hidden) -> float:
    """How much earlier than its time stamp a reading was true."""
    return hidden["reading_s"] if hidden.id == "transport_delay" else 0.0


def answer(hidden: Hidden) -> Answer | None:
    """How the supply follows commands with this effect; None where the effect is another one."""
    if hidden.id == "slew_limit":
        return Answer(SLEW, hidden["rate_V_per_s"], hidden["landing_s"])
    if hidden.id == "supply_fall_lag":
        return Answer(FALL, hidden["tau_s"], hidden["bleed_V"])
    if hidden.id == "source_resistance":
        return Answer(LAG, hidden["tau_s"], hidden["second_tau_s"])
    return None


def at_electrodes(hidden: Hidden, voltage_V: Array) -> Array:
    """Static part of the supply, shape (n, 5)."""
    if hidden.id != "dead_zone":
        return voltage_V
    excess = np.abs(voltage_V) - hidden["half_width_V"]
    width = hidden["shoulder_V"]
    at_zero = 0.5 * (math.hypot(hidden["half_width_V"], width) - hidden["half_width_V"])
    return np.sign(voltage_V) * (0.5 * (np.sqrt(excess * excess + width * width) + excess) - at_zero)
