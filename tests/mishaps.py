"""Frames with which something is wrong, each with every displacement that may rightly be read from it.

Where the list of right readings is empty, the only right answer is that the tip is lost.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from bender_emulator.microscope import Scene
from bender_emulator.microscope.dirt import dust, fibre, grain, speck
from bender_emulator.microscope.optics import Table, bar, step

Picture = NDArray[np.uint8]
Bad = tuple[Picture, tuple[float, ...]]
Mishap = Callable[[Scene, float, np.random.Generator], Bad]


def sound(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """Nothing is wrong but what is wrong with the scene."""
    return scene.render(tip_um, rng.uniform(0.0, 2000.0), 0.004), (tip_um,)


def no_wire(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """The wire has fallen off."""
    levels = scene.light * _through(scene, rng, 30, 100, 6)
    return scene.develop(levels), ()


def another_wire(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """The wire is gone and something thinner or thicker hangs into the picture."""
    factor = rng.uniform(0.35, 0.7) if rng.random() < 0.5 else rng.uniform(1.8, 3.0)
    return scene.develop(scene.light * (1.0 - _stray(scene, rng, factor))), ()


def two_wires(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """A second wire as thick as the first, anywhere."""
    return scene.develop(scene.clean(tip_um) * (1.0 - _stray(scene, rng, 1.0))), (tip_um,)


def out_of_view(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """The tip has left the picture, or nearly."""
    span_um = scene.settings.height_px * scene.settings.um_per_px
    far_um = float(rng.choice([-1.0, 1.0])) * rng.uniform(0.3, 0.8) * span_um
    return scene.develop(scene.clean(far_um)), (far_um,)


def too_long(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """The end of the wire lies beyond the border."""
    _, y = scene.tip_px(tip_um)
    shade = _wire_shade(scene, (scene.settings.width_px + rng.uniform(-15.0, 60.0), y), rng.uniform(-0.1, 0.1), 1.0)
    return scene.develop(scene.light * (1.0 - shade)), ()


def dark(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """The lamp is off, or nearly."""
    return scene.develop(scene.clean(tip_um) * np.float32(rng.uniform(0.0, 0.3) ** 2)), (tip_um,)


def overexposed(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """Too much light for the sensor."""
    return scene.develop(scene.clean(tip_um) * np.float32(rng.uniform(1.2, 12.0))), (tip_um,)


def heavy_dirt(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """Dirt everywhere."""
    levels = scene.clean(tip_um) * _through(scene, rng, 40, 300, 15)
    return scene.develop(levels), (tip_um,)


def dirty_tip(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """Large grains on the wire and its end."""
    x, y = scene.tip_px(tip_um)
    through = np.ones(scene.shape)
    for _ in range(rng.integers(1, 4)):
        spot = x + rng.uniform(-60.0, 20.0), y + rng.uniform(-15.0, 15.0)
        grain(through, spot, rng.uniform(2.0, 15.0), rng.uniform(0.2, 0.9))
    return scene.develop(scene.clean(tip_um) * through.astype(np.float32)), (tip_um,)


def broken(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """A bright gap in the wire, or its end bright."""
    levels = scene.clean(tip_um)
    x, _ = scene.tip_px(tip_um)
    start = int(rng.uniform(0.2, 1.0) * x)
    gap = slice(start, start + int(rng.integers(2, 80)))
    levels[:, gap] = scene.light[:, gap]
    return scene.develop(levels), (tip_um,)


def torn(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """The upper rows of one frame over the lower rows of another."""
    other_um = tip_um + rng.uniform(-40.0, 40.0)
    picture, other = scene.render(tip_um), scene.render(other_um)
    _, y = scene.tip_px(tip_um)
    row = int(np.clip(rng.normal(y, 25.0), 0, scene.shape[0]))
    picture[row:] = other[row:]
    return picture, (tip_um, other_um)


def shifted(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """Bytes of a line were lost: everything after them has moved, and wraps around."""
    picture = scene.render(tip_um)
    by = int(rng.integers(1, scene.settings.width_px))
    return np.roll(picture.ravel(), -by if rng.random() < 0.5 else by).reshape(picture.shape), (tip_um,)


def half_missing(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """The decoder gave up: what follows is grey, black, or the last line again."""
    picture = scene.render(tip_um)
    row = int(rng.integers(0, scene.shape[0] - 1))
    picture[row + 1 :] = [np.uint8(128), np.uint8(0), picture[row]][rng.integers(3)]
    return picture, (tip_um,)


def garbled(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """A band of lines, or all of them, are noise."""
    picture = scene.render(tip_um)
    row = int(rng.integers(-100, scene.shape[0]))
    band = slice(max(0, row), row + int(rng.choice([10, 60, 600])) + 100)
    picture[band] = rng.integers(0, 256, picture[band].shape, np.uint8)
    return picture, (tip_um,)


def out_of_focus(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """The focus was lost."""
    return scene.develop(gaussian_filter(scene.clean(tip_um), rng.uniform(4.0, 14.0))), (tip_um,)


def smeared(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """Far too long an exposure of a moving tip."""
    return scene.develop(scene.clean(tip_um, rng.uniform(10.0, 60.0))), (tip_um,)


def shadowed(scene: Scene, tip_um: float, rng: np.random.Generator) -> Bad:
    """Something large has moved into the light."""
    y, x = np.indices(scene.shape, dtype=np.float32)
    way = rng.uniform(0.0, 2.0 * math.pi)
    tip_x, tip_y = scene.tip_px(tip_um)
    off = (x - tip_x) * math.cos(way) + (y - tip_y) * math.sin(way) - rng.uniform(-150.0, 150.0)
    shade = rng.uniform(0.5, 1.0) / (1.0 + np.exp(np.clip(-off / rng.uniform(0.5, 20.0), -50.0, 50.0)))
    return scene.develop((scene.clean(tip_um) * (1.0 - shade)).astype(np.float32)), (tip_um,)


MISHAPS: Mapping[str, Mishap] = {
    function.__name__: function
    for function in (
        sound, no_wire, another_wire, two_wires, out_of_view, too_long, dark, overexposed, heavy_dirt, dirty_tip,
        broken, torn, shifted, half_missing, garbled, out_of_focus, smeared, shadowed,
    )
}  # fmt: skip


def _through(scene: Scene, rng: np.random.Generator, discs: int, specks: int, fibres: int) -> NDArray[np.float32]:
    """What fresh dirt lets through; the numbers are the most there may be."""
    through = np.ones(scene.shape)
    for most, drop in ((discs, dust), (specks, speck), (fibres, fibre)):
        for _ in range(rng.integers(most // 3, most + 1)):
            drop(through, (rng.uniform(0, scene.shape[1]), rng.uniform(0, scene.shape[0])), rng)
    return through.astype(np.float32)


def _stray(scene: Scene, rng: np.random.Generator, factor: float) -> NDArray[np.float32]:
    """The shade of a wire that ends anywhere, mostly from the left as the true one."""
    end = rng.uniform(60.0, scene.shape[1]), rng.uniform(0.0, scene.shape[0])
    angle = rng.uniform(-0.2, 0.2) if rng.random() < 0.7 else rng.uniform(0.0, 2.0 * math.pi)
    return _wire_shade(scene, end, angle, factor)


def _wire_shade(scene: Scene, end: tuple[float, float], angle: float, factor: float) -> NDArray[np.float32]:
    settings = scene.settings
    width_px = factor * settings.wire_um / settings.um_per_px
    reach = width_px + 6.0 * settings.blur_px + 2.0
    across = Table(settings.opacity * bar(Table.places(reach), width_px, settings.blur_px), reach)
    along = Table(step(-Table.places(reach), settings.blur_px), reach)
    y, x = np.indices(scene.shape, dtype=np.float32)
    x -= np.float32(end[0])
    y -= np.float32(end[1])
    cosine, sine = np.float32(math.cos(angle)), np.float32(math.sin(angle))
    return across(y * cosine - x * sine) * along(x * cosine + y * sine)
