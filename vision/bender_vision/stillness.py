"""Whether the picture around the wire is new: a sensor's noise never repeats, tile by tile.

A frozen driver may still count time in a corner, and a decoder fills what a torn stream lacks with the picture before.
So pictures are not compared as a whole but in tiles beside the wire's last part: in how many pixels two pictures in a
row are equal, against what was usual while the rest position was taken.
"""

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from bender_vision.settings import TrackerSettings

TILE_PX = 16
_USUAL_MOST = 0.9
"""Tiles that repeat themselves more than this at rest (a reticle, a flat background in a JPEG) say nothing."""
_DEAD = 0.999
_FEWEST_TILES = 4
_FROZEN_TILES = 0.25
_ACROSS_WIDTHS = 2.5

Image = NDArray[np.uint8]
Shares = NDArray[np.float64]


def equal_shares(image: Image, before: Image) -> Shares:
    """Return for each whole tile, (rows, columns), in which share of its pixels two pictures are equal."""
    rows, columns = (size // TILE_PX for size in image.shape)
    height, width = rows * TILE_PX, columns * TILE_PX
    same = image[:height, :width] == before[:height, :width]
    return same.reshape(rows, TILE_PX, columns, TILE_PX).mean(axis=(1, 3))


class Stillness:
    """Follows the pictures of one camera.

    Args:
        settings: where the wire enters, and how long a part of it is looked at.
        width_px: of the wire.
    """

    def __init__(self, settings: TrackerSettings, width_px: float) -> None:
        self._settings, self._width_px = settings, width_px
        self._usual: Shares | None = None
        self._least: Shares | None = None
        self._before: Image | None = None
        self.count = 0
        """Pictures in a row whose surroundings of the wire were those of the picture before."""

    def learn(self, images: list[Image]) -> None:
        """Take what is usual from pictures in a row of the wire at rest; all of one shape."""
        pairs = [equal_shares(after, before) for before, after in itertools.pairwise(images)]
        self._usual = np.max(pairs, axis=0) if pairs else None
        self._least = np.min(pairs, axis=0) if pairs else None
        self._before, self.count = (images[-1] if images else None), 0

    def is_dead(self, along_px: float, across_px: float) -> bool:
        """Whether what was learnt shows no noise at all beside the wire, as no live picture does."""
        if self._least is None or self._before is None or math.isnan(along_px):
            return False
        tiles = self._beside_the_wire(self._before.shape, along_px, across_px)
        return bool(np.min(self._least[tiles]) > _DEAD)

    def add(self, image: Image, along_px: float, across_px: float) -> int:
        """Take the next picture with the tip in it, as `Tip` has it; returns `count`.

        A tip that was lost (NaN), or too few tiles that tell anything, leave the count at 0.
        """
        before, self._before = self._before, image
        usual = self._usual
        if usual is None or before is None or before.shape != image.shape or math.isnan(along_px):
            self.count = 0
            return 0
        tiles = self._beside_the_wire(image.shape, along_px, across_px)
        telling = usual[tiles] <= _USUAL_MOST
        pixels = tuple(slice(part.start * TILE_PX, part.stop * TILE_PX) for part in tiles)
        frozen = equal_shares(image[pixels], before[pixels]) > 0.5 * (1.0 + usual[tiles])
        enough = np.count_nonzero(telling) >= _FEWEST_TILES
        is_frozen = enough and np.count_nonzero(frozen & telling) >= _FROZEN_TILES * np.count_nonzero(telling)
        self.count = self.count + 1 if is_frozen else 0
        return self.count

    def _beside_the_wire(self, shape: tuple[int, ...], along_px: float, across_px: float) -> tuple[slice, slice]:
        """The tiles beside the last part of the wire, as (rows, columns) of tiles."""
        length_px = self._settings.fit_widths * self._width_px
        around_px = _ACROSS_WIDTHS * self._width_px
        border = self._settings.enters_from
        is_upright = border in ("top", "bottom")
        along_size, across_size = (shape[0], shape[1]) if is_upright else (shape[1], shape[0])
        first, last = along_px - length_px, along_px
        if border in ("right", "bottom"):
            first, last = along_size - 1 - last, along_size - 1 - first
        along = _tiles(first, last, along_size)
        across = _tiles(across_px - around_px, across_px + around_px, across_size)
        return (along, across) if is_upright else (across, along)


def _tiles(first_px: float, last_px: float, size_px: int) -> slice:
    count = size_px // TILE_PX
    first = min(max(0, math.floor(first_px / TILE_PX)), count - 1)
    last = min(max(first, math.floor(last_px / TILE_PX)), count - 1)
    return slice(first, last + 1)
