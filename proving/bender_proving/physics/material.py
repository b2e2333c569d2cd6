"""The material: from the electrode voltage to the displacement that drives the structure.

What bends the voltage sits before equation (30), what adds to the displacement after it.
"""

import math

import numpy as np
from scipy.optimize import root_scalar

from bender_proving.physics import duhem, preisach, spectra
from bender_proving.physics.grid import Grid
from bender_proving.cases.hidden import Ask, Effect, Hidden, Values
from bender_proving.physics.lobatto import Array, lag
from bender_proving.cases.nominal import FULL_STROKE_UM, FULL_VOLTAGE_V

_BAND = (0.87, 1.0, 1.15)
_CYCLE_V = np.concatenate([np.linspace(0, 50, 201), np.linspace(50, 0, 201)[1:]] * 2)


def _flattened(form: str, share: Array | float) -> Array:
    """V / v_s over an odd curve of slope 1 at 0, at `share` = v / v_s."""
    x = np.abs(share)
    if form == "arctangent":
        return np.asarray(np.arctan(share))
    if form == "langevin":
        small = x < 1e-2
        safe = np.where(small, 1.0, x)
        curve = np.where(small, x - x**3 / 15.0, 3.0 / np.tanh(safe) - 3.0 / safe)
        return np.sign(share) * curve
    return np.asarray(2.0 * np.arctan(np.tanh(0.5 * np.asarray(share))))


def _draw_leakage(ask: Ask) -> Values:
    tau_s = ask.log_uniform(1.0, min(100.0, 0.5 * ask.setting.duration_s))
    return {"fraction": ask.size, "tau_s": tau_s}


def _draw_saturation(ask: Ask) -> Values:
    def excess(scale_V: float) -> float:
        reached = scale_V * float(_flattened(ask.form, FULL_VOLTAGE_V / scale_V))
        return 1.0 - reached / FULL_VOLTAGE_V - ask.size

    bracket = (0.05 * FULL_VOLTAGE_V, 100.0 * FULL_VOLTAGE_V)
    return {"scale_V": float(root_scalar(excess, bracket=bracket, method="brentq").root)}


def _draw_electrostriction(ask: Ask) -> Values:
    """Even in the voltage and quadratic at first, never a pure square: that is the catalogue's."""
    at_full_um = ask.size * FULL_STROKE_UM
    if ask.form == "hyperbolic":
        scale_V = ask.uniform(80.0, 160.0)
        return {"at_scale_um": at_full_um / (math.cosh(FULL_VOLTAGE_V / scale_V) - 1.0), "scale_V": scale_V}
    bend = ask.uniform(0.01, 0.03)
    return {"c_um_per_V2": at_full_um / (1.0 - bend) / FULL_VOLTAGE_V**2, "bend_per_V2": bend / FULL_VOLTAGE_V**2}


def _draw_hysteresis(ask: Ask) -> Values:
    """Where the operator climbs with the voltage, the chord of its settled 0-50-0 V loop is taken off.

    A slope without memory is no part of the effect.
    """
    if ask.form == "dahl":
        values = {"limit_V": ask.log_uniform(3.0, 20.0), "power": ask.uniform(0.8, 1.8)}
    elif ask.form == "duhem":
        values = {
            "reach_V": ask.log_uniform(4.0, 20.0), "middle_V": ask.uniform(18.0, 32.0),
            "bend_V": ask.uniform(35.0, 90.0), "reversible": ask.uniform(0.0, 0.5),
        }  # fmt: skip
    else:
        values = {
            "width_V": ask.uniform(1.0, 7.0), "spread_V": ask.uniform(1.5, 6.0),
            "centre_V": ask.uniform(20.0, 30.0), "centre_spread_V": ask.uniform(25.0, 60.0),
        }  # fmt: skip
    loop = _remember(ask.form, values, _CYCLE_V)[-401:]
    scale_um = ask.size * FULL_STROKE_UM / float(np.max(np.abs(loop[200::-1] - loop[200:])))
    chord = 0.0 if ask.form == "dahl" else float(loop[200] - loop[400]) / FULL_VOLTAGE_V
    return values | {"scale_um": scale_um, "chord_um_per_V": scale_um * chord}


def _draw_creep(ask: Ask) -> Values:
    if ask.form == "power_law":
        return {"growth": ask.size, "exponent": ask.uniform(0.03, 0.3)}
    if ask.form == "stretched":
        return {"growth": ask.size, "tau_s": ask.log_uniform(1.0, 30.0), "exponent": ask.uniform(0.4, 0.75)}
    if ask.form == "one_unit":
        return {"growth": ask.size, "tau_s": ask.log_uniform(3.0, 40.0)}
    return {"growth": ask.size, "centre_s": ask.log_uniform(1.0, 20.0), "width": ask.uniform(0.7, 1.8)}


EFFECTS = (
    Effect(
        "charge_leakage", "material", "fraction of the low-pass", "1", {"camera": (0.02, 0.6)}, False,
        ("one_path", "three_paths"), _draw_leakage,
    ),
    Effect(
        "saturation", "material", "loss at 50 V", "1", {"camera": (0.01, 0.6), "vibrometer": (0.01, 0.6)}, False,
        ("arctangent", "langevin", "gudermann"), _draw_saturation,
    ),
    Effect(
        "electrostriction", "material", "share of the stroke at 50 V", "1",
        {"camera": (0.005, 0.6), "vibrometer": (0.005, 0.6)}, True, ("quadratic_bending", "hyperbolic"),
        _draw_electrostriction,
    ),
    Effect(
        "rate_independent_hysteresis", "material", "opening of the 0-50-0 V loop over the stroke", "1",
        {"camera": (0.005, 0.4)}, False, ("preisach_gauss", "preisach_lorentz", "dahl", "duhem"), _draw_hysteresis,
    ),
    Effect(
        "creep", "material", "growth from 0.1 s to 100 s over the step", "1", {"camera": (0.01, 0.4)}, False,
        ("power_law", "stretched", "band"), _draw_creep,
    ),
)  # fmt: skip


def before(hidden: Hidden, voltage_V: Array, grid: Grid) -> Array:
    """The voltage that equation (30) sees, shape (n, 5)."""
    if hidden.id == "saturation":
        scale_V = hidden["scale_V"]
        return scale_V * _flattened(hidden.form, voltage_V / scale_V)
    if hidden.id == "charge_leakage":
        spreads = (1.0,) if hidden.form == "one_path" else _BAND
        share = hidden["fraction"] / len(spreads)
        leaks = [lag(voltage_V, grid.step_s, spread * hidden["tau_s"], 0.0) for spread in spreads]
        return voltage_V - share * np.sum(leaks, axis=0)
    return voltage_V


def after(hidden: Hidden, w_um: Array, voltage_V: Array, grid: Grid) -> Array:
    """What drives the structure, given w of equation (30) and the electrode voltage, shapes (n, 5)."""
    match hidden.id:
        case "electrostriction" if hidden.form == "hyperbolic":
            return w_um + hidden["at_scale_um"] * (np.cosh(voltage_V / hidden["scale_V"]) - 1.0)
        case "electrostriction":
            square = voltage_V * voltage_V
            return w_um + hidden["c_um_per_V2"] * square * (1.0 - hidden["bend_per_V2"] * square)
        case "rate_independent_hysteresis":
            path = np.ascontiguousarray(voltage_V).reshape(-1)
            values = dict(hidden.parameters)
            memory = hidden["scale_um"] * _remember(hidden.form, values, path).reshape(voltage_V.shape)
            return w_um + memory - hidden["chord_um_per_V"] * voltage_V
        case "creep":
            weights, tau_s = _spectrum(hidden)
            return w_um + spectra.copies(w_um, grid.step_s, tau_s, weights)
    return w_um


def _remember(form: str, values: Values, path_V: Array) -> Array:
    if form.startswith("preisach"):
        law = form.removeprefix("preisach_")
        tables = preisach.relays(
            law, values["width_V"], values["spread_V"], values["centre_V"], values["centre_spread_V"]
        )
        return preisach.respond(tables.everett, tables.virgin, path_V)
    names = ("limit_V", "power") if form == "dahl" else ("reach_V", "middle_V", "bend_V", "reversible")
    kind = duhem.DAHL if form == "dahl" else duhem.DUHEM
    return duhem.respond(kind, np.array([values[name] for name in names]), path_V)


def _spectrum(hidden: Hidden) -> tuple[Array, Array]:
    if hidden.form == "one_unit":
        tau_s = hidden["tau_s"]
        return np.array([hidden["growth"] / spectra.single(tau_s)]), np.array([tau_s])
    if hidden.form == "power_law":
        weights = spectra.power_law(hidden["exponent"])
    elif hidden.form == "stretched":
        weights = spectra.stretched(hidden["tau_s"], hidden["exponent"])
    else:
        weights = spectra.band(hidden["centre_s"], hidden["width"])
    weights = weights * (hidden["growth"] / spectra.grown(weights, spectra.TAU_S))
    used = weights > 1e-6 * np.max(np.abs(weights), initial=0.0)
    return weights[used], spectra.TAU_S[used]
