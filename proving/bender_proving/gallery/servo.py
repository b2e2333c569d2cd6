"""A position servo whose guide rubs: the friction model of Lund and Grenoble with its authors' numbers.

m x'' = k_p (r - x) - k_d x' - F,   F = s0 z + s1 z' + s2 x',   z' = x' - |x'| z / g(x'),
s0 g(v) = F_c + (F_s - F_c) exp(-(v / v_s)^2)
"""

import math

import numpy as np
from numpy.random import Generator

from bender_proving.gallery.played import integrated, levels, read
from bender_proving.gallery.rig import Array, PublishedRig, RigRecord

MASS_KG, STIFFNESS_N_PER_M, DAMPING_NS_PER_M = 1.0, 400.0, 12.0
BRISTLE_N_PER_M, BRISTLE_NS_PER_M, VISCOUS_NS_PER_M = 1e5, math.sqrt(1e5), 0.4
SLIDING_N, BREAKAWAY_N, STRIBECK_M_PER_S = 1.0, 1.5, 0.001
ROW_S, HELD, MOVES, NOISE_MM = 0.02, 75, 16, 0.01
FREQUENCY_HZ = math.sqrt(STIFFNESS_N_PER_M / MASS_KG) / (2.0 * math.pi)
DAMPING = (DAMPING_NS_PER_M + VISCOUS_NS_PER_M) / (2.0 * math.sqrt(STIFFNESS_N_PER_M * MASS_KG))


def slope(time_s: float, state: Array, target_m: float) -> Array:
    """Return x', x'' and z'."""
    del time_s
    x, v, z = state
    level = (SLIDING_N + (BREAKAWAY_N - SLIDING_N) * math.exp(-((v / STRIBECK_M_PER_S) ** 2))) / BRISTLE_N_PER_M
    bristle = v - abs(v) * z / level
    friction = BRISTLE_N_PER_M * z + BRISTLE_NS_PER_M * bristle + VISCOUS_NS_PER_M * v
    return np.array([v, (STIFFNESS_N_PER_M * (target_m - x) - DAMPING_NS_PER_M * v - friction) / MASS_KG, bristle])


def play(rng: Generator) -> RigRecord:
    """Moves to places drawn from a stroke of 40 mm."""
    places_mm = np.round(rng.uniform(0.0, 40.0, MOVES), 1)
    target_mm = levels(places_mm, HELD)
    time_s = ROW_S * np.arange(target_mm.size, dtype=np.float64)
    states = integrated(slope, np.zeros(3), time_s, 1e-3 * target_mm, 0.05)
    return read(time_s, target_mm, 1e3 * states[:, 0], NOISE_MM, rng)


SERVO = PublishedRig(
    "servo",
    "a position servo whose guide rubs",
    "Canudas de Wit, Olsson, Åström and Lischinsky 1995, doi:10.1109/9.376053",
    ("target", "mm"),
    ("position", "mm"),
    1.0,
    (),
    (FREQUENCY_HZ, DAMPING),
    "dry friction of 1 N, 1.5 N to break away",
    frozenset({"coulomb_friction"}),
    play,
)
