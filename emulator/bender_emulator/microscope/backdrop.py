"""What lies behind the wire: uneven light, and dirt."""

import math

import numpy as np
from numpy.typing import NDArray

from bender_emulator.microscope.dirt import dust, fibre, speck
from bender_emulator.microscope.settings import SceneSettings

Picture = NDArray[np.float32]


def backdrop(settings: SceneSettings, rng: np.random.Generator) -> Picture:
    """The picture without wire and noise, in levels, (height, width)."""
    through = np.ones((settings.height_px, settings.width_px))
    for count, drop in ((settings.dust, dust), (settings.specks, speck), (settings.fibres, fibre)):
        for _ in range(count):
            drop(through, (rng.uniform(0, settings.width_px), rng.uniform(0, settings.height_px)), rng)
    return (_light(settings, rng) * through).astype(np.float32)


def _light(settings: SceneSettings, rng: np.random.Generator) -> NDArray[np.float64]:
    """The lamp is never quite in the middle, and the tube darkens the corners."""
    y, x = np.indices((settings.height_px, settings.width_px), dtype=np.float64)
    half = math.hypot(settings.width_px, settings.height_px) / 2
    u, v = (x - settings.width_px / 2) / half, (y - settings.height_px / 2) / half
    direction = rng.uniform(0.0, 2.0 * math.pi)
    off_x, off_y = rng.uniform(-0.15, 0.15, 2)
    slope = 0.5 * settings.light_slope * (math.cos(direction) * u + math.sin(direction) * v)
    corner = settings.vignette * ((u - off_x) ** 2 + (v - off_y) ** 2) ** 1.5
    return settings.light_levels * np.clip(1.0 + slope - corner, 0.02, None)
