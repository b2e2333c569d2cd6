"""The structure: from what drives it to the true tip."""

import math
from dataclasses import dataclass

import numpy as np
from bender_proving.physics import nonlinear_mode
from bender_proving.physics.grid import Grid
from bender_proving.cases.hidden import NOISE_UM, Ask, Effect, Hidden, Values
from bender_proving.physics.lobatto import Array, linear_mode
from bender_proving.cases.nominal import FULL_STROKE_UM, OMEGA, ZETA
from bender_proving.physics.play import play

_SMOOTH, _CURVED, _KINKED = 0.6, 0.25, 0.15


def _draw_second(ask: Ask) -> Values:
    ratio = ask.log_uniform(2.2, 6.8)
    return {"share": ask.size, "frequency_ratio": ratio, "damping_ratio": ask.log_uniform(0.004, 0.04)}


def _draw_tip_mass(ask: Ask) -> Values:
    ratio = 1.0 + ask.size
    return {"frequency_ratio": ratio, "static_gain": 1.0 if ask.form == "added_mass" else ratio**-2}


def _draw_damping(ask: Ask) -> Values:
    """Drag of the air is the quadratic part: a small share of the damping of a swing of 5 um amplitude."""
    most = 5e-3 if ask.setting.sensor == "camera" else 1e-3
    share = 0.0 if ask.form == "viscous" else ask.log_uniform(0.2 * most, most)
    swing_um = 5.0
    drag_per_um = share * 2.0 * ask.size * 3.0 * math.pi / (8.0 * swing_um)
    return {"damping_ratio": ask.size * (1.0 - share), "drag_per_um": drag_per_um}


def _draw_stiffening(ask: Ask) -> Values:
    """A sine or sinh is as good as its cubic where it is weak; a quintic part is given at twice the full stroke."""
    weakest, bend = (0.03, 0.02) if ask.setting.sensor == "camera" else (0.008, 0.003)
    if ask.form == "sine" and abs(ask.size) > weakest:
        raise ValueError(f"magnitude of stiffening as a sine must be at most {weakest}, found {ask.size!r}")
    # never a pure cubic: that is the catalogue's
    quintic = math.copysign(ask.uniform(0.3 * bend, bend), ask.uniform(-1.0, 1.0)) if ask.form != "sine" else 0.0
    return {"k3_per_um2": ask.size / FULL_STROKE_UM**2, "quintic_per_um2": quintic / (2.0 * FULL_STROKE_UM) ** 2}


def _draw_backlash(ask: Ask) -> Values:
    spread_um = NOISE_UM[ask.setting.sensor] * ask.uniform(0.5, 1.0) if ask.form == "three_gaps" else 0.0
    return {"half_width_um": ask.size, "spread_um": min(0.03 * ask.size, spread_um)}


EFFECTS = (
    Effect(
        "second_mode", "structure", "share of the static tip", "1", {"vibrometer": (0.01, 0.3)}, False,
        ("parts_of_one", "on_top"), _draw_second,
    ),
    Effect(
        "tip_mass", "structure", "relative shift of the frequency", "1",
        {"camera": (0.003, 0.5), "vibrometer": (0.002, 0.5)}, True, ("added_mass", "stiffness"), _draw_tip_mass,
    ),
    Effect(
        "structural_damping", "structure", "damping ratio", "1",
        {"camera": (0.001, 0.3), "vibrometer": (0.001, 0.3)}, False, ("viscous", "viscous_and_drag"), _draw_damping,
        ZETA,
    ),
    Effect(
        "stiffening", "structure", "cubic over linear force at full stroke", "1",
        {"camera": (0.005, 0.5), "vibrometer": (0.005, 0.5)}, True, ("cubic_quintic", "sine"),
        _draw_stiffening,
    ),
    Effect(
        "backlash", "structure", "half-width", "um", {"camera": (0.1, 5.0), "vibrometer": (0.1, 5.0)}, False,
        ("one_gap", "three_gaps"), _draw_backlash,
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Tip:
    """True tip and its speed at the nodes, shapes (n, 5)."""

    position_um: Array
    speed_um_per_s: Array


def longest_step_s(hidden: tuple[Hidden, ...]) -> float:
    """Longest sub-step that keeps every mode here within a millionth of a micrometre."""
    limits = [_SMOOTH / OMEGA]
    for effect in hidden:
        match effect.id:
            case "second_mode":
                limits.append(_SMOOTH / (OMEGA * effect["frequency_ratio"]))
            case "tip_mass":
                limits.append(_SMOOTH / (OMEGA * effect["frequency_ratio"]))
            case "structural_damping" | "stiffening":
                limits.append(_CURVED / OMEGA)
            case "backlash":
                limits.append(_KINKED / OMEGA)
    return min(limits)


def tip(hidden: tuple[Hidden, ...], w_um: Array, grid: Grid) -> Tip:
    """What the structure makes of its drive `w_um`, shape (n, 5), with the effects of this stage."""
    omega, zeta, gain, k3, quintic, drag, kind = OMEGA, ZETA, 1.0, 0.0, 0.0, 0.0, nonlinear_mode.CUBIC
    for effect in hidden:
        match effect.id:
            case "tip_mass":
                omega, gain = OMEGA * effect["frequency_ratio"], effect["static_gain"]
            case "structural_damping":
                zeta, drag = effect["damping_ratio"], effect["drag_per_um"]
            case "stiffening":
                k3, quintic = effect["k3_per_um2"], effect["quintic_per_um2"]
                kind = nonlinear_mode.SINE if effect.form == "sine" else nonlinear_mode.CUBIC
    if k3 == 0.0 and drag == 0.0:
        q, p = linear_mode(gain * w_um, grid.step_s, omega, zeta)
    else:
        q, p = nonlinear_mode.single_mode(gain * w_um, grid.step_s, omega, zeta, kind, k3, quintic, drag)
    swing = Tip(q, p)
    for effect in hidden:
        if effect.id == "second_mode":
            swing = _with_second(effect, swing, gain * w_um, grid)
        elif effect.id == "backlash":
            swing = _with_play(effect, swing, grid)
    return swing


def _with_second(effect: Hidden, first: Tip, drive_um: Array, grid: Grid) -> Tip:
    share = effect["share"]
    q, p = linear_mode(drive_um, grid.step_s, OMEGA * effect["frequency_ratio"], effect["damping_ratio"])
    kept = 1.0 - share if effect.form == "parts_of_one" else 1.0
    return Tip(kept * first.position_um + share * q, kept * first.speed_um_per_s + share * p)


def _with_play(effect: Hidden, swing: Tip, grid: Grid) -> Tip:
    q, p = np.ascontiguousarray(swing.position_um), np.ascontiguousarray(swing.speed_um_per_s)
    spreads = (0.0,) if effect["spread_um"] == 0.0 else (-1.0, 0.0, 1.0)
    gaps_um = [effect["half_width_um"] + spread * effect["spread_um"] for spread in spreads]
    follower = [play(q, p, grid.step_s, gap_um) for gap_um in gaps_um]
    return Tip(np.mean(follower, axis=0), p)
