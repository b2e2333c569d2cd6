"""The wire to a fraction of a pixel: the middle between its edges, a line through it, and where it ends."""

import math

import numpy as np
from numpy.typing import NDArray

from bender_vision.lines import middle_of, robust_line
from bender_vision.rough import RoughWire
from bender_vision.strip import Strip, Values, unroll
from bender_vision.tip import Sighting, TipLostError

_END_CLEAR_WIDTHS = 0.8
_BEYOND_WIDTHS = 4.0
_LEAST_COLUMNS = 12
# Smoothing by one pixel makes neighbouring columns share their errors: 2 sqrt(pi) of them count as one.
_COLUMNS_PER_ERROR = 3.5
_DOUBTED_FROM_PX = 0.1
_DOUBTED_SPREADS, _NEVER_DOUBTED_PX = 3.5, 0.25
_LARGEST_IMBALANCE = 0.12
_EDGE_FOOT, _EDGE_HEAD = 0.3, 0.7
"""Of the darkness: between these two levels the softness of the edges is measured."""
_LEVELS = (1.0 / 12.0, 0.25, 5.0 / 12.0)
"""Of the darkness: the middles of the sixths below its half; the two edges of one level stand for a pair of levels."""
_TAKEN_WIDTHS = 1.2
"""On either side of the middle: a wire that moves by no more than its own width takes its light from within one."""
# Below it the whole levels of the picture show in the place of the edges.
_LEAST_LEVELS = 12.0


def measure_wire(image: NDArray[np.uint8], rough: RoughWire, width_px: float, fit_widths: float) -> Sighting:
    """Measure the wire near its end.

    Raises:
        TipLostError: what is there is not one straight wire with a clear end.
    """
    first = rough.end_x - (fit_widths + 1.0) * width_px
    strip = unroll(image, rough.line, first, rough.end_x + _BEYOND_WIDTHS * width_px, width_px)
    core = strip.core(0.2 * width_px)
    shaft = strip.x <= rough.end_x - _END_CLEAR_WIDTHS * width_px
    if np.count_nonzero(shaft) < _LEAST_COLUMNS:
        raise TipLostError("too little of the wire is in view")
    depth = middle_of(core[shaft])
    if depth * middle_of(strip.light[shaft]) < _LEAST_LEVELS:
        raise TipLostError("it is too dark around the wire")
    upper, lower = _edges(strip, 0.5 * depth)
    middle, width = strip.y + 0.5 * (lower - upper), upper + lower
    usual = middle_of(width[shaft])
    if not math.isfinite(usual):
        raise TipLostError("the wire has no clear edges")
    good = shaft & _alike(width, usual, shaft) & (strip.imbalance <= _LARGEST_IMBALANCE)
    if np.count_nonzero(good) < _LEAST_COLUMNS:
        raise TipLostError("the wire has no clear edges")
    line = robust_line(strip.x[good], middle[good], _DOUBTED_FROM_PX)
    # at the end and not on the average: in a frame torn within the wire one edge runs away from the other
    thickness = robust_line(strip.x[good], width[good], _DOUBTED_FROM_PX)
    end_x = _end(strip.x, core, depth, rough.end_x, usual)
    centre = _centres(strip, depth)
    sure = good & np.isfinite(centre)
    centre_y = math.nan
    if np.count_nonzero(sure) >= _LEAST_COLUMNS:
        centre_y = robust_line(strip.x[sure], centre[sure], _DOUBTED_FROM_PX).value(end_x)
    used = strip.x <= end_x - _END_CLEAR_WIDTHS * width_px
    return Sighting(
        x=end_x,
        y=line.value(end_x),
        slope=line.slope,
        width=thickness.value(end_x) * math.cos(math.atan(line.slope)),
        depth=depth,
        spread=line.spread_at(end_x) * math.sqrt(_COLUMNS_PER_ERROR),
        softness=_softness(strip, depth, good),
        centre_y=centre_y,
        taken=middle_of(strip.within(_TAKEN_WIDTHS * width_px).sum(axis=0)[good]),
        share=min(1.0, line.count / max(1, np.count_nonzero(used))),
    )


def _alike(width: Values, usual: float, shaft: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Columns as wide as the others: what clings to one side of the wire moves one edge and not the other."""
    off = np.abs(width - usual)
    usual_off = 1.4826 * middle_of(off[shaft])
    return off <= min(max(_DOUBTED_SPREADS * usual_off, _NEVER_DOUBTED_PX), max(0.7, 0.1 * usual))


def _edges(strip: Strip, level: float) -> tuple[Values, Values]:
    """Distance from the strip's middle up and down to where the darkness first falls below `level`; nan if nowhere."""
    up = strip.darkness[strip.half :: -1]
    down = strip.darkness[strip.half :]
    return _first_fall(up, level), _first_fall(down, level)


def _softness(strip: Strip, depth: float, good: NDArray[np.bool_]) -> float:
    """How much wider the wire is at the foot of its edges than at their head, in pixels; nan where that is nowhere."""
    foot, head = (np.add(*_edges(strip, x * depth)) for x in (_EDGE_FOOT, _EDGE_HEAD))
    wider = (foot - head)[good]
    wider = wider[np.isfinite(wider)]
    return middle_of(wider) if wider.size else math.nan


def _centres(strip: Strip, depth: float) -> Values:
    """The mean place of the wire in each column, from where its edges cross levels spread over its darkness.

    Light adds up. At the share q of the darkness the wire had passed the one edge for the share q of the exposure, and
    the other for 1 - q: their middle is the mean of the quantiles q and 1 - q of its place. The mean over the levels
    below the half, where no glint lies, is thus the mean place, however the wire moved; the middle at half the darkness
    is where it was for half of the time.
    """
    crossings = [np.subtract(*_edges(strip, x * depth)[::-1]) for x in _LEVELS]
    return strip.y + 0.5 * np.mean(crossings, axis=0)


def _first_fall(profiles: Values, level: float) -> Values:
    """For each column, the place, in rows, where it first falls below `level`."""
    below = profiles < level
    row = below.argmax(axis=0)
    column = np.arange(profiles.shape[1])
    before, after = profiles[np.maximum(row - 1, 0), column], profiles[row, column]
    fall = before - after
    with np.errstate(divide="ignore", invalid="ignore"):
        place = row - 1 + (before - level) / fall
    return np.where((row > 0) & (fall > 0.0), place, np.nan)


def _end(x: Values, core: Values, depth: float, rough_end_x: float, width: float) -> float:
    """Where the wire's darkness falls to its half for good."""
    inside = int(np.searchsorted(x, rough_end_x - 2.0 * width))
    part = core[inside:]
    below = part < 0.5 * depth
    if part.size < 3 or below[0] or not below.any():
        raise TipLostError("the end of the wire is out of view")
    index = int(below.argmax())
    beyond = part[index : index + math.ceil(2.0 * width)]
    if beyond.size < math.ceil(0.8 * width):
        raise TipLostError("the end of the wire is out of view")
    if (beyond[math.ceil(0.4 * width) :] > 0.4 * depth).any():
        raise TipLostError("something lies at the end of the wire")
    before, after = part[index - 1], part[index]
    return float(x[inside + index - 1] + (before - 0.5 * depth) / (before - after))
