"""Where the residual lives: its energy by time, voltage, direction, rate, hold or move, frequency.

For each axis the narrowest range is reported that holds most of the energy above what noise alone would leave there.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from bender_inference.records.noise import interpolated
from bender_inference.records.observations import Array, Mask, Observations
from bender_loop.records.acting_voltage import direction

BINS = 12
MOST = 0.7
MORE_THAN_ROWS = 0.1
"""By which the part of the energy on one side exceeds the part of the rows there: less tells nothing."""


@dataclass(frozen=True, slots=True)
class ResidualRange:
    """A range of an axis and the share of the residual's energy that lies in it."""

    axis: str
    range: tuple[float, float]
    unit: str
    share: float

    def to_dict(self) -> dict[str, Any]:
        """Return the place as `diagnosis.json` has it."""
        return asdict(self) | {"range": list(self.range), "share": round(self.share, 3)}


def _narrowest(energy: Array, edges: Array) -> tuple[float, float, float]:
    """Return the narrowest run of bins that holds most of the energy: its ends and its share."""
    total = float(energy.sum())
    cumulated = np.concatenate([[0.0], np.cumsum(energy)]) / total
    best = (float(edges[0]), float(edges[-1]), 1.0)
    for i in range(energy.size):
        for j in range(i + 1, energy.size + 1):
            share = cumulated[j] - cumulated[i]
            if share >= MOST and edges[j] - edges[i] < best[1] - best[0]:
                best = (float(edges[i]), float(edges[j]), float(share))
    return best


def _along(axis: str, unit: str, at: Array, square: Array, noise_um: float) -> ResidualRange | None:
    """Return the range of an axis; None where it is all of it, which tells nothing."""
    low, high = float(at.min()), float(at.max())
    if high <= low:
        return None
    edges = np.linspace(low, high, BINS + 1)
    bins = np.clip(np.digitize(at, edges) - 1, 0, BINS - 1)
    energy = np.bincount(bins, square, BINS) - noise_um**2 * np.bincount(bins, minlength=BINS)
    energy = np.maximum(energy, 0.0)
    if energy.sum() <= 0.0:
        return None
    begin, end, share = _narrowest(energy, edges)
    if end - begin >= high - low:
        return None
    return ResidualRange(axis, (begin, end), unit, share)


def _split(axis: str, unit: str, mask: Mask, square: Array, ends: tuple[float, float]) -> ResidualRange | None:
    """Return on which side of a split most of the energy lies; None where that is no more than its part of the rows."""
    total = float(square.sum())
    share = float(square[mask].sum()) / total if total > 0.0 else 0.0
    rows = float(mask.mean())
    if not 0.0 < rows < 1.0:
        return None
    inside = share >= 0.5
    part, of_rows = (share, rows) if inside else (1.0 - share, 1.0 - rows)
    if part < of_rows + MORE_THAN_ROWS:
        return None
    return ResidualRange(axis, (ends[0], ends[0]) if inside else (ends[1], ends[1]), unit, part)


def residual_ranges(x: Observations, residual: Array, noise_um: float) -> list[ResidualRange]:
    """Return where the energy of a residual lies, axis by axis, the most telling first."""
    rows = np.nonzero(x.usable)[0]
    r = residual[rows] - residual[rows].mean()
    square = r**2
    command = x.acting_V
    changed = np.diff(command, prepend=0.0)
    steps = np.diff(x.time_s, prepend=x.time_s[0] - 1.0)
    # before its first change a voltage neither rises nor falls
    rising = (direction(command) > 0.0) & np.logical_or.accumulate(changed != 0.0)
    found = [
        _along("time", "s", x.time_s[rows], square, noise_um),
        _along("voltage", "V", command[rows], square, noise_um),
        _along("rate", "V/s", np.abs(changed / steps)[rows], square, noise_um),
        _split("direction", "1", rising[rows], square, (1.0, -1.0)),
        _split("hold", "1", changed[rows] == 0.0, square, (1.0, 0.0)),
        _frequency(x, residual, noise_um),
    ]
    return [place for place in found if place is not None]


def _frequency(x: Observations, residual: Array, noise_um: float) -> ResidualRange | None:
    filled = interpolated(np.nan_to_num(residual), x.usable)
    filled = filled - filled.mean()
    step = float(np.median(np.diff(x.time_s)))
    power = np.abs(np.fft.rfft(filled)) ** 2 / filled.size
    frequencies = np.asarray(np.fft.rfftfreq(filled.size, step)[1:], dtype=np.float64)
    return _along("frequency", "Hz", frequencies, power[1:], noise_um)
