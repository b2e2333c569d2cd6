"""Small charts as inline SVG: a strip of a distribution, a scatter over the days."""

from collections.abc import Callable, Sequence
from datetime import date
from html import escape
from itertools import pairwise

import numpy as np

from bender_fleet.population.features import Array, Feature
from bender_fleet.population.trends import Drift
from bender_report.chart import thinned
from bender_report.wording import quantity

STRIP_WIDTH, STRIP_HEIGHT = 220, 26
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 640, 220, 62, 12, 12, 28
MOST_DOTS, _PIECES = 1500, 12


def strip(feature: Feature) -> str:
    """Return a distribution: a line from 5 to 95 %, a box from 25 to 75 %, a mark at the median; outer values as dots.

    The scale is that on which units are compared, from the smallest value to the largest.
    """
    values = feature.comparable[np.isfinite(feature.comparable)]
    if values.size < 2 or float(np.ptp(values)) == 0.0:
        return ""
    low, high = float(values.min()), float(values.max())
    q = np.quantile(values, [0.05, 0.25, 0.5, 0.75, 0.95])
    x5, x25, x50, x75, x95 = ((float(v) - low) / (high - low) * (STRIP_WIDTH - 12) + 6 for v in q)
    outer = values[(values < q[0]) | (values > q[4])]
    outer = outer[thinned(np.sort(outer), 60)] if outer.size > 60 else outer
    dots = "".join(
        f'<circle cx="{(float(v) - low) / (high - low) * (STRIP_WIDTH - 12) + 6:.1f}" cy="13" r="1.6"/>' for v in outer
    )
    return (
        f'<svg class="strip" viewBox="0 0 {STRIP_WIDTH} {STRIP_HEIGHT}" role="img" aria-label="distribution of '
        f'{escape(feature.label)}"><g class="dots">{dots}</g><path class="line" d="M{x5:.1f} 13H{x95:.1f}"/>'
        f'<rect class="box" x="{x25:.1f}" y="7" width="{max(x75 - x25, 1.0):.1f}" height="12" rx="2"/>'
        f'<path class="median" d="M{x50:.1f} 4V22"/></svg>'
    )


def scatter(drift: Drift) -> str:
    """Return the values over the days, thinned where there are many, with the medians of twelve pieces of time."""
    step = max(1, drift.days.size // MOST_DOTS)
    days, values = drift.days[::step], drift.values[::step]
    low, high = _limits(drift.values)
    first, last = float(drift.days.min()), float(drift.days.max())

    def x_of(day: float) -> float:
        return _LEFT + (day - first) / max(last - first, 1.0) * (_WIDTH - _LEFT - _RIGHT)

    def y_of(value: float) -> float:
        inside = min(max(value, low), high)
        return _HEIGHT - _BOTTOM - (inside - low) / (high - low) * (_HEIGHT - _TOP - _BOTTOM)

    dots = "".join(f"M{x_of(d):.1f} {y_of(v):.1f}h0" for d, v in zip(days.tolist(), values.tolist(), strict=True))
    path = " ".join(f"{x_of(d):.1f},{y_of(v):.1f}" for d, v in _medians(drift.days, drift.values))
    return (
        f'<svg class="scatter" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" '
        f'aria-label="{escape(drift.label)} over the date">'
        f"{_axes(low, high, drift.unit, first, last, y_of)}"
        f'<path class="cloud" d="{dots}"/><polyline class="middle" points="{path}"/></svg>'
    )


def _axes(low: float, high: float, unit: str, first: float, last: float, y_of: Callable[[float], float]) -> str:
    marks = [low, 0.5 * (low + high), high]
    lines = "".join(f'<path class="rule" d="M{_LEFT} {y_of(v):.1f}H{_WIDTH - _RIGHT}"/>' for v in marks)
    words = "".join(
        f'<text x="{_LEFT - 6}" y="{y_of(v) + 4:.1f}" text-anchor="end">{quantity(v, unit, 3)}</text>' for v in marks
    )
    ends = (
        f'<text x="{_LEFT}" y="{_HEIGHT - 6}">{date.fromordinal(int(first))}</text>'
        f'<text x="{_WIDTH - _RIGHT}" y="{_HEIGHT - 6}" text-anchor="end">{date.fromordinal(int(last))}</text>'
    )
    return lines + words + ends


def _limits(values: Array) -> tuple[float, float]:
    low, high = (float(x) for x in np.quantile(values, [0.005, 0.995]))
    room = 0.05 * (high - low) or max(abs(high), 1.0) * 0.05
    return low - room, high + room


def _medians(days: Array, values: Array) -> Sequence[tuple[float, float]]:
    edges = np.linspace(days.min(), days.max() + 1e-9, _PIECES + 1)
    middle = np.mean if set(np.unique(values)) <= {0.0, 1.0} else np.median
    found = []
    for start, stop in pairwise(edges.tolist()):
        own = (days >= start) & (days < stop)
        if own.any():
            found.append((float(np.mean(days[own])), float(middle(values[own]))))
    return found
