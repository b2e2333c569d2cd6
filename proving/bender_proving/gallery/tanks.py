"""Two tanks in a row, of which the upper one overflows: water leaves each by a hole, after Torricelli.

x1' = -k1 sqrt(x1) + k4 u, at most 10;   x2' = k2 sqrt(x1) - k3 sqrt(x2), at most 10
"""

import math

import numpy as np
from numpy.random import Generator

from bender_proving.gallery.played import integrated, read
from bender_proving.gallery.rig import Array, PublishedRig, RigRecord

OUT_UPPER, INTO_LOWER, OUT_LOWER, PUMP, FULL = 0.5, 0.4, 0.45, 0.45, 10.0
"""Roots of centimetres per second, and centimetres per second and volt; the rim of both tanks."""
AROUND_V, SPREAD_V = 3.0, 1.0
ROW_S, HELD, MOVES, NOISE_CM = 1.0, 60, 24, 0.02
UPPER_CM = (PUMP * AROUND_V / OUT_UPPER) ** 2
LOWER_CM = UPPER_CM * (INTO_LOWER / OUT_LOWER) ** 2
UPPER_S, LOWER_S = 2.0 * math.sqrt(UPPER_CM) / OUT_UPPER, 2.0 * math.sqrt(LOWER_CM) / OUT_LOWER


def slope(time_s: float, state: Array, pump_V: float) -> Array:
    """Return x1' and x2'; what would rise above a rim flows away."""
    del time_s
    upper, lower = np.maximum(state, 0.0)
    rising = np.array(
        [
            PUMP * (AROUND_V + pump_V) - OUT_UPPER * math.sqrt(upper),
            INTO_LOWER * math.sqrt(upper) - OUT_LOWER * math.sqrt(lower),
        ]
    )
    return np.where((state >= FULL) & (rising > 0.0), 0.0, rising)


def play(rng: Generator) -> RigRecord:
    """Steps of the pump about the level at which the model is linear; the level of the lower tank from there."""
    pump_V = np.concatenate([np.zeros(5), np.repeat(np.round(rng.uniform(-SPREAD_V, SPREAD_V, MOVES), 2), HELD)])
    time_s = ROW_S * np.arange(pump_V.size, dtype=np.float64)
    states = integrated(slope, np.array([UPPER_CM, LOWER_CM]), time_s, pump_V, 0.5, "RK23")
    return read(time_s, pump_V, np.minimum(states[:, 1], FULL) - LOWER_CM, NOISE_CM, rng)


TANKS = PublishedRig(
    "tanks",
    "two tanks in a row, of which the upper one overflows",
    "Schoukens and Noël 2017, doi:10.1016/j.ifacol.2017.08.071",
    ("pump", "V"),
    ("level", "cm"),
    2.0 * LOWER_CM / AROUND_V,
    (UPPER_S, LOWER_S),
    None,
    "a rim over which water flows away, inside the chain, and outflows that go with the root of the level",
    frozenset(),
    play,
)
