"""A stage micrometer under the emulated microscope: one millimetre in a hundred lines, with a known scale."""

import math

import numpy as np
from numpy.typing import NDArray

from bender_emulator.microscope.optics import Table, bar, step
from bender_emulator.microscope.scene import Scene

_LINE_UM = 2.5
_OPACITY = 0.8
_LINES = 100
# half lengths of the lines: all, every fifth, every tenth
_LENGTHS_UM = ((1, 150.0), (5, 220.0), (10, 300.0))


def render_micrometer(
    scene: Scene, *, pitch_um: float = 10.0, angle_deg: float = 0.0, offset_um: tuple[float, float] = (0.0, 0.0)
) -> NDArray[np.uint8]:
    """The ruler in the light, lens, dirt and noise of a scene, without its wire.

    Args:
        scene: its light, lens and sensor.
        pitch_um: distance of the lines.
        angle_deg: of the direction along which they are counted; 0 counts along the picture's rows.
        offset_um: of the ruler's middle from the picture's, along and across that direction.
    """
    settings = scene.settings
    angle = math.radians(angle_deg)
    x, y = scene.object_um()
    along = x * math.cos(angle) + y * math.sin(angle) - offset_um[0]
    across = np.abs(y * math.cos(angle) - x * math.sin(angle) - offset_um[1])
    scale = settings.um_per_px
    reach_px = (pitch_um + _LINE_UM) / scale + 6.0 * settings.blur_px + 2.0
    across_lines = Table(bar(Table.places(reach_px), _LINE_UM / scale, settings.blur_px), reach_px)
    ends = Table(step(-Table.places(reach_px), settings.blur_px), reach_px)
    nearest = np.rint(along / pitch_um)
    dark = np.zeros_like(along)
    # the blur of a line reaches under its neighbours
    for neighbour in range(-2, 3):
        number = nearest + neighbour
        half_um = _half_length_um(number)
        line = across_lines(((along - number * pitch_um) / scale).astype(np.float32))
        dark += line * ends(((across - half_um) / scale).astype(np.float32))
    return scene.develop(scene.light * (1.0 - _OPACITY * np.minimum(dark, 1.0)).astype(np.float32))


def _half_length_um(number: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half the length of the lines of these numbers; what is not on the ruler is far shorter than nothing."""
    half = np.full_like(number, -1e6)
    there = np.abs(number) <= _LINES / 2
    for every, length in _LENGTHS_UM:
        half[there & (number % every == 0)] = length
    return half
