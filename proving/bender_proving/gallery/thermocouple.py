"""An oven and the thermocouple in it, which lags behind the air as a sheathed one does.

T1 x' = g u - x,   T2 y' = x - y
"""

import numpy as np
from numpy.random import Generator

from bender_proving.gallery.played import integrated, levels, read
from bender_proving.gallery.rig import Array, PublishedRig, RigRecord

GAIN_K_PER_PERCENT, OVEN_S, SHEATH_S = 2.0, 40.0, 6.0
ROW_S, HELD, MOVES, NOISE_K = 1.0, 90, 12, 0.05


def slope(time_s: float, state: Array, power_percent: float) -> Array:
    """Return the slopes of the air and of the junction."""
    del time_s
    air, junction = state
    return np.array([(GAIN_K_PER_PERCENT * power_percent - air) / OVEN_S, (air - junction) / SHEATH_S])


def play(rng: Generator) -> RigRecord:
    """Steps of the heating power."""
    power_percent = levels(np.round(rng.uniform(0.0, 60.0, MOVES)), HELD)
    time_s = ROW_S * np.arange(power_percent.size, dtype=np.float64)
    states = integrated(slope, np.zeros(2), time_s, power_percent, 5.0)
    return read(time_s, power_percent, states[:, 1], NOISE_K, rng)


THERMOCOUPLE = PublishedRig(
    "thermocouple",
    "an oven and the thermocouple in it, which lags",
    "Michalski, Eckersdorf, Kucharski and McGhee 2001, Temperature Measurement, doi:10.1002/0470846135",
    ("power", "%"),
    ("temperature", "K"),
    GAIN_K_PER_PERCENT,
    (OVEN_S,),
    None,
    "the lag of a sheath, 6 s",
    frozenset({"sensor_lag"}),
    play,
)
