"""A proportional valve with overlap: the spool moves some way before it opens a port.

x'' + 2 d w x' + w^2 x = w^2 u,   q = g sign(x) max(|x| - overlap, 0)
"""

import math

import numpy as np
from numpy.random import Generator

from bender_proving.gallery.played import integrated, levels, read
from bender_proving.gallery.rig import Array, PublishedRig, RigRecord

FREQUENCY_HZ, DAMPING, OVERLAP_V, GAIN_LPM_PER_V = 12.0, 0.8, 0.6, 4.0
ROW_S, HELD, MOVES, NOISE_LPM = 0.01, 40, 40, 0.05


def slope(time_s: float, state: Array, command_V: float) -> Array:
    """Return the spool's speed and acceleration."""
    del time_s
    x, v = state
    w = 2.0 * math.pi * FREQUENCY_HZ
    return np.array([v, w * w * (command_V - x) - 2.0 * DAMPING * w * v])


def play(rng: Generator) -> RigRecord:
    """Steps of the command, both ways."""
    command_V = levels(np.round(rng.uniform(-5.0, 5.0, MOVES), 2), HELD)
    time_s = ROW_S * np.arange(command_V.size, dtype=np.float64)
    x = integrated(slope, np.zeros(2), time_s, command_V, 0.05)[:, 0]
    return read(time_s, command_V, GAIN_LPM_PER_V * np.sign(x) * np.maximum(np.abs(x) - OVERLAP_V, 0.0), NOISE_LPM, rng)


VALVE = PublishedRig(
    "valve",
    "a proportional valve with overlap",
    "Jelali and Kroll 2003, Hydraulic Servo-systems, doi:10.1007/978-1-4471-0099-7",
    ("command", "V"),
    ("flow", "l/min"),
    GAIN_LPM_PER_V,
    (),
    (FREQUENCY_HZ, DAMPING),
    "an overlap of 0.6 V on either side, behind the spool",
    frozenset({"output_dead_zone"}),
    play,
)
