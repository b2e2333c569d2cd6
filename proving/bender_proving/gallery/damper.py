"""A friction damper whose band has clearance: a slider behind contacts of Hertz that have to cross a gap first.

F = k sign(e) max(|e| - gap, 0)^1.5,   de/dx = 1 - |F / F_s|^n where the motion loads the contacts, 1 where it does not
"""

import math

import numpy as np
from numpy.random import Generator

from bender_proving.gallery.played import levels, read
from bender_proving.gallery.rig import Array, PublishedRig, RigRecord

SLIDING_KN, STIFFNESS_KN, GAP_MM, SHARPNESS = 12.0, 12.0, 1.5, 6
"""The contacts carry `STIFFNESS_KN` when they are pressed by 1 mm."""
ROW_S, HELD, CYCLES, LEVELS, PARTS, NOISE_KN = 0.05, 2, 8, 60, 40, 0.08
STROKE_MM = 20.0
GAIN_KN_PER_MM = 0.6


def force_kN(pressed_mm: float) -> float:
    """Return what the contacts pass on when the band is away from its middle by so much."""
    return STIFFNESS_KN * math.copysign(max(abs(pressed_mm) - GAP_MM, 0.0) ** 1.5, pressed_mm)


def forces_kN(travel_mm: Array) -> Array:
    """Return the force (n,) at every place (n,) of a journey that begins at 0."""
    pressed, last, found = 0.0, 0.0, []
    for place in travel_mm:
        step = (float(place) - last) / PARTS
        for _ in range(PARTS):
            force = force_kN(pressed)
            slips = abs(force / SLIDING_KN) ** SHARPNESS if step * force > 0.0 else 0.0
            pressed += step * max(1.0 - slips, 0.0)
        last = float(place)
        found.append(force_kN(pressed))
    return np.array(found)


def play(rng: Generator) -> RigRecord:
    """Cycles of several strokes, held at many places on the way."""
    strokes = STROKE_MM * rng.permutation(np.linspace(1.0, CYCLES, CYCLES) / CYCLES)
    phase = 2.0 * math.pi * np.arange(1, LEVELS + 1) / LEVELS
    places: Array = np.outer(strokes, np.sin(phase)).ravel()
    travel_mm = levels(np.round(places, 3), HELD)
    reached = forces_kN(travel_mm)
    time_s = ROW_S * np.arange(travel_mm.size, dtype=np.float64)
    # a row that moves on shows what was reached before it
    return read(time_s, travel_mm, np.append(reached[0], reached[:-1]), NOISE_KN, rng)


DAMPER = PublishedRig(
    "damper",
    "a friction damper whose band has clearance",
    "Iwan 1966, doi:10.1115/1.3625199 (slider), Johnson 1985, doi:10.1017/CBO9781139171731 (contacts)",
    ("travel", "mm"),
    ("force", "kN"),
    GAIN_KN_PER_MM,
    (),
    None,
    "a slider that holds 12 kN, and a gap of 3 mm in series with it",
    frozenset({"rate_independent_hysteresis", "output_dead_zone"}),
    play,
)
