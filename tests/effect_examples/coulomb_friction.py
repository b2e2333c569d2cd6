"""Dry friction, integrated from rest to rest with events."""

import math
from typing import Any

import numpy as np
from chain_oracle import with_dry_friction

PARAMETERS: list[dict[str, Any]] = [
    {"level_um": 1.0},
    {"level_um": 0.5, "breakaway_ratio": 1.8, "stribeck_um_per_s": 2000.0},
]


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    kinetic, speed = parameters["level_um"], parameters.get("stribeck_um_per_s", 1.0)
    rest = kinetic * parameters.get("breakaway_ratio", 1.0)
    return with_dry_friction(
        voltages_V, step_s, lambda v: kinetic + (rest - kinetic) * math.exp(-((v / speed) ** 2)), rest
    )
