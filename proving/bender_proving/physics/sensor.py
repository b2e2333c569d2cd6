"""The sensor: from the tip in its room to the reading."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import root_scalar

from bender_proving.physics.grid import Grid
from bender_proving.cases.hidden import Ask, Effect, Hidden, Values, two_poles
from bender_proving.physics.lobatto import Array, lag
from bender_proving.cases.nominal import FULL_STROKE_UM

_SEEN_UM = np.linspace(-45.0, 75.0, 241)
_STEEPEST, _FLATTEST = 3.0, 0.15
_THIRD = 0.4


def _draw_lag(ask: Ask) -> Values:
    """Three poles: two small ones beside the lag, or a row of falling size; one and two are the catalogue's."""
    if ask.form == "small_poles":
        two = two_poles(ask)
        third_s = _THIRD * two["second_tau_s"]
        return two | {"tau_s": two["tau_s"] - third_s, "third_tau_s": third_s}
    second = ask.uniform(0.01, 0.03)
    return {
        "tau_s": ask.size * (1.0 - second - second**2),
        "second_tau_s": ask.size * second,
        "third_tau_s": ask.size * second**2,
    }


def _draw_lens(ask: Ask) -> Values:
    centre_um = 0.0 if ask.form == "tilted" else math.copysign(ask.uniform(35.0, 60.0), ask.size)

    def excess(strength: float) -> float:
        image_um = _curve(ask.form, strength, centre_um, np.array([FULL_STROKE_UM]))
        return float(image_um[0]) / FULL_STROKE_UM - 1.0 - ask.size

    low, high = (-0.9 / FULL_STROKE_UM, 2.0 / FULL_STROKE_UM) if ask.form == "tilted" else (1e-9, 0.2)
    strength = float(root_scalar(excess, bracket=(low, high), method="brentq").root)
    slope = np.gradient(_curve(ask.form, strength, centre_um, _SEEN_UM), _SEEN_UM)
    if slope.min() < _FLATTEST or slope.max() > _STEEPEST:
        raise ValueError(f"magnitude of lens_distortion as {ask.form} folds or tears the image, found {ask.size!r}")
    return {"strength": strength, "centre_um": centre_um}


def _draw_quantisation(ask: Ask) -> Values:
    return {"step_um": ask.size}


EFFECTS = (
    Effect(
        "sensor_lag", "sensor", "time constant", "s", {"camera": (1e-3, 1.0), "vibrometer": (0.5e-3, 0.1)}, False,
        ("small_poles", "three_poles"), _draw_lag,
    ),
    Effect(
        "lens_distortion", "sensor", "relative error at full stroke", "1",
        {"camera": (0.005, 0.4), "vibrometer": (0.005, 0.4)}, True, ("tilted", "division", "arctangent"), _draw_lens,
    ),
    Effect(
        "sensor_quantisation", "sensor", "step", "um", {"camera": (0.05, 3.0), "vibrometer": (0.05, 3.0)}, False,
        ("nearest", "whole_pixels"), _draw_quantisation,
    ),
)  # fmt: skip


def _image(form: str, strength: float, x: Array) -> tuple[Array, Array]:
    """Image of x and its slope: a tilted plane, the division model of a lens, an equidistant fisheye."""
    if form == "tilted":
        return x / (1.0 + strength * x), 1.0 / (1.0 + strength * x) ** 2
    if form == "division":
        square = (strength * x) ** 2
        return x / (1.0 + square), (1.0 - square) / (1.0 + square) ** 2
    return np.arctan(strength * x) / strength, 1.0 / (1.0 + (strength * x) ** 2)


def _curve(form: str, strength: float, centre_um: float, r: Array) -> Array:
    """The image around the bench's zero: 0 at 0 with slope 1 there."""
    if strength == 0.0:
        return r
    origin, slope = _image(form, strength, np.array(-centre_um))
    return (_image(form, strength, r - centre_um)[0] - origin) / slope


def poles_s(hidden: Hidden) -> tuple[float, ...]:
    """Time constants of the sensor's poles, the slowest first; none of one that follows at once."""
    if hidden.id != "sensor_lag":
        return ()
    named = dict(hidden.parameters)
    return tuple(x for x in (named.get(name, 0.0) for name in ("tau_s", "second_tau_s", "third_tau_s")) if x > 0.0)


def follow(hidden: Hidden, signal_um: Array, grid: Grid, standing_um: Sequence[float]) -> Array:
    """Dynamic part of the sensor, shape (n, 5); behind every pole, what it has shown the bench at rest."""
    followed = signal_um
    for tau_s, start_um in zip(poles_s(hidden), standing_um, strict=True):
        followed = lag(np.ascontiguousarray(followed), grid.step_s, tau_s, start_um)
    return followed


def fastest_rad_per_s(hidden: Hidden) -> float:
    """Rate that the sub-steps have to follow; 0 where nothing is dynamic."""
    return 0.25 / hidden["tau_s"] if hidden.id == "sensor_lag" else 0.0


def map_rows(hidden: Hidden, reading_um: Array) -> Array:
    """Static part of the sensor at the rows, without noise."""
    if hidden.id != "lens_distortion":
        return reading_um
    return _curve(hidden.form, hidden["strength"], hidden["centre_um"], reading_um)


def round_rows(hidden: Hidden, reading_um: Array) -> Array:
    """Rounding of readings that have their noise."""
    if hidden.id != "sensor_quantisation":
        return reading_um
    steps = reading_um / hidden["step_um"]
    return hidden["step_um"] * (np.floor(steps) if hidden.form == "whole_pixels" else np.rint(steps))
