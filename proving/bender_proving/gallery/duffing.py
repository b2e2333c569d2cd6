"""An oscillator whose spring stiffens: Duffing's equation.

x'' + 2 d w x' + w^2 (x + b x^3) = w^2 g u
"""

import math

import numpy as np
from numpy.random import Generator

from bender_proving.gallery.played import integrated, levels, read
from bender_proving.gallery.rig import Array, PublishedRig, RigRecord

FREQUENCY_HZ, DAMPING, GAIN_MM_PER_N, CUBIC_PER_MM2 = 8.0, 0.06, 2.0, 0.02
ROW_S, HELD, MOVES, NOISE_MM = 0.01, 60, 30, 0.005


def slope(time_s: float, state: Array, force_N: float) -> Array:
    """Return x' and x''."""
    del time_s
    x, v = state
    w = 2.0 * math.pi * FREQUENCY_HZ
    return np.array([v, w * w * (GAIN_MM_PER_N * force_N - x - CUBIC_PER_MM2 * x**3) - 2.0 * DAMPING * w * v])


def play(rng: Generator) -> RigRecord:
    """Steps of the force, up and down."""
    force_N = levels(np.round(rng.uniform(-2.0, 2.0, MOVES), 2), HELD)
    time_s = ROW_S * np.arange(force_N.size, dtype=np.float64)
    states = integrated(slope, np.zeros(2), time_s, force_N, 0.05)
    return read(time_s, force_N, states[:, 0], NOISE_MM, rng)


DUFFING = PublishedRig(
    "duffing",
    "an oscillator whose spring stiffens",
    "Kovacic and Brennan 2011, The Duffing Equation, doi:10.1002/9780470977859",
    ("force", "N"),
    ("displacement", "mm"),
    GAIN_MM_PER_N,
    (),
    (FREQUENCY_HZ, DAMPING),
    "a cubic spring",
    frozenset({"stiffening"}),
    play,
)
