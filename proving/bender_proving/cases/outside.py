"""Effects that no entry of the catalogue describes; an honest diagnosis of them is that they are unexplained.

Those that happen by chance draw their events from a generator whose seed is one of their parameters, so that the same
bench meets them again in the same record and others in the next one.
"""

import math

import numpy as np
from numpy.random import Generator, default_rng

from bender_proving.physics.uncatalogued import exchange
from bender_proving.physics.grid import Grid
from bender_proving.cases.hidden import Ask, Effect, Hidden, Setting, Values
from bender_proving.physics.lobatto import Array, C, varying_lag
from bender_proving.cases.nominal import FULL_VOLTAGE_V, OMEGA, ZETA
from bender_proving.physics.uncatalogued.telegraph import ratchet, telegraph


def _seed(rng: Generator) -> float:
    return float(rng.integers(2**31))


def _pace_s(setting: Setting) -> float:
    """Typical time between two events of chance: many in a record, each over many rows."""
    return 0.02 * setting.duration_s


def _draw_one_sided(ask: Ask) -> Values:
    return {"gap_um": ask.size, "um_per_V": ask.uniform(0.2, 0.6), "tau_s": ask.log_uniform(0.3, 3.0)}


def _draw_late(ask: Ask) -> Values:
    return {"longest_s": ask.size, "power": ask.uniform(1.0, 2.0)}


def _draw_stick_slip(ask: Ask) -> Values:
    return {"size_um": ask.size, "pace_s": _pace_s(ask.setting) * ask.log_uniform(0.5, 1.5), "seed": _seed(ask.rng)}


def _draw_exchange(ask: Ask) -> Values:
    return {
        "coupling_per_um": ask.size, "frequency_ratio": ask.uniform(0.48, 0.52),
        "damping_ratio": ask.log_uniform(0.003, 0.01), "share": ask.uniform(0.05, 0.15),
    }  # fmt: skip


def _draw_temperature(ask: Ask) -> Values:
    return {"size_um": ask.size, "play": ask.uniform(0.3, 0.7), "seed": _seed(ask.rng)}


def _draw_contact(ask: Ask) -> Values:
    return {"lost_gain": ask.size, "pace_s": _pace_s(ask.setting) * ask.log_uniform(0.5, 1.5), "seed": _seed(ask.rng)}


def _draw_varying_lag(ask: Ask) -> Values:
    """`magnitude` is the time constant at 0 V; at 50 V it is 50 to 200 times smaller or larger."""
    factor = ask.log_uniform(50.0, 200.0) ** (1.0 if ask.form == "faster_with_voltage" else -1.0)
    return {"tau_at_rest_s": ask.size, "e_fold_V": FULL_VOLTAGE_V / math.log(factor)}


def _draw_clamp(ask: Ask) -> Values:
    return {
        "offset_um": ask.size, "lost_gain": ask.uniform(0.05, 0.2), "pace_s": _pace_s(ask.setting),
        "tilt_V": ask.uniform(10.0, 20.0), "seed": _seed(ask.rng),
    }  # fmt: skip


EFFECTS = (
    Effect(
        "one_sided_play", "outside", "widest gap", "um", {"camera": (0.8, 6.0)}, False, ("relaxing",),
        _draw_one_sided,
    ),
    Effect(
        "amplitude_dependent_delay", "outside", "delay of a step of 50 V", "s", {"camera": (0.05, 0.4)}, False,
        ("power",), _draw_late,
    ),
    Effect(
        "stick_slip", "outside", "size of a slip", "um", {"camera": (0.5, 4.0), "vibrometer": (0.2, 2.0)}, False,
        ("at_random",), _draw_stick_slip,
    ),
    Effect(
        "energy_exchange", "outside", "coupling", "1/um", {"vibrometer": (3e-3, 1.2e-2)}, False, ("two_to_one",),
        _draw_exchange,
    ),
    Effect(
        "temperature_hysteresis", "outside", "size", "um", {"camera": (0.5, 4.0)}, False, ("play",),
        _draw_temperature,
    ),
    Effect(
        "intermittent_contact", "outside", "gain lost", "1", {"camera": (0.1, 0.6), "vibrometer": (0.1, 0.6)}, False,
        ("telegraph",), _draw_contact,
    ),
    Effect(
        "voltage_dependent_time_constant", "outside", "time constant at 0 V", "s", {"camera": (0.03, 3.0)}, False,
        ("faster_with_voltage", "slower_with_voltage"), _draw_varying_lag,
    ),
    Effect(
        "metastable_clamp", "outside", "offset of the second state", "um",
        {"camera": (0.5, 4.0), "vibrometer": (0.2, 2.0)}, True, ("two_states",), _draw_clamp,
    ),
)  # fmt: skip


def renewed(hidden: Hidden, rng: Generator) -> Hidden:
    """The same effect meeting other chances, for another record of the bench."""
    values = dict(hidden.parameters)
    if "seed" not in values:
        return hidden
    return Hidden(hidden.id, hidden.form, hidden.magnitude, tuple((values | {"seed": _seed(rng)}).items()))


def shift_commands(hidden: Hidden, act_s: Array, target_V: Array) -> Array:
    """When commands act: larger moves later than small ones, none before its predecessor."""
    if hidden.id != "amplitude_dependent_delay":
        return act_s
    jumps = np.abs(np.diff(target_V, prepend=0.0))
    late_s = hidden["longest_s"] * (jumps / FULL_VOLTAGE_V) ** hidden["power"]
    return np.maximum.accumulate(act_s + late_s)


def after_material(hidden: Hidden, w_um: Array, voltage_V: Array, grid: Grid) -> Array:
    """What the material makes of its displacement `w_um`, given the electrode voltage, shapes (n, 5)."""
    if hidden.id == "one_sided_play":
        elapsed_s = grid.step_s[:, None] * np.diff(C, prepend=0.0)
        gap = ratchet(voltage_V, elapsed_s, hidden["um_per_V"], hidden["gap_um"], hidden["tau_s"])
        return w_um + gap
    if hidden.id == "voltage_dependent_time_constant":
        rate = np.exp(voltage_V / hidden["e_fold_V"]) / hidden["tau_at_rest_s"]
        return varying_lag(w_um, grid.step_s, rate, 0.0)
    return w_um


def modes(hidden: Hidden, w_um: Array, grid: Grid) -> Array | None:
    """The tip, shape (n, 5), where the effect replaces the first mode; None where it does not."""
    if hidden.id != "energy_exchange":
        return None
    ratio = hidden["frequency_ratio"]
    p = (OMEGA, ZETA, OMEGA * ratio, hidden["damping_ratio"], hidden["coupling_per_um"], hidden["share"])
    return exchange.modes(w_um, grid.step_s, np.array(p))


def after_structure(hidden: Hidden, tip_um: Array, voltage_V: Array, grid: Grid) -> Array:
    """What chance and the room make of the tip, shape (n, 5); constant over a sub-step where it jumps."""
    match hidden.id:
        case "stick_slip":
            rng = default_rng(int(hidden["seed"]))
            return tip_um + hidden["size_um"] * _slips(rng, hidden["pace_s"], grid.middle_s)[:, None]
        case "temperature_hysteresis":
            rng = default_rng(int(hidden["seed"]))
            return tip_um + hidden["size_um"] * _room(rng, hidden["play"], grid)
        case "intermittent_contact":
            state = telegraph(grid.step_s, np.zeros(len(grid.step_s)), hidden["pace_s"], int(hidden["seed"]))
            return tip_um * (1.0 - hidden["lost_gain"] * state[:, None])
        case "metastable_clamp":
            tilt = (voltage_V[:, 0] - 0.5 * FULL_VOLTAGE_V) / hidden["tilt_V"]
            state = telegraph(grid.step_s, tilt, hidden["pace_s"], int(hidden["seed"]))[:, None]
            return tip_um * (1.0 - hidden["lost_gain"] * state) + hidden["offset_um"] * state
    return tip_um


def _slips(rng: Generator, pace_s: float, time_s: Array) -> Array:
    """A level that jumps to a new place, independent of the last one, after waiting times without memory."""
    last_s = float(time_s[-1])
    times = np.cumsum(rng.exponential(pace_s, size=int(10 + 4 * last_s / pace_s)))
    levels = np.concatenate([[0.0], rng.choice([-1.0, 1.0], len(times)) * rng.uniform(0.5, 1.5, len(times))])
    return levels[np.searchsorted(times, time_s)]


def _room(rng: Generator, width: float, grid: Grid) -> Array:
    """Play on an irregular room temperature; between about -1 and 1, flat wherever the temperature turns."""
    span_s = float(grid.start_s[-1] + grid.step_s[-1])
    coarse_s = np.linspace(0.0, span_s, 4000)
    cycles = rng.uniform(2.0, 12.0, 5)
    phases = rng.uniform(0.0, 2.0 * math.pi, 5)
    heat = np.sum(np.sin(2.0 * math.pi * cycles * coarse_s[:, None] / span_s + phases) / 5.0**0.5, axis=1)
    followed = np.empty_like(heat)
    y = heat[0]
    for k, x in enumerate(heat):
        y = min(max(y, x - width), x + width)
        followed[k] = y
    return np.interp(grid.nodes_s, coarse_s, followed - followed[0])
