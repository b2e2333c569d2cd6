"""What the voltage of a record excites: nothing, one cycle over and over, or more."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_loop.errors import InputError
from bender_report.record_overlay import reversals

Array = NDArray[np.float64]

STILL = 1e-9
SAME = 0.05
"""Turning points within this part of the span, and cycles within this part of their length, are the same."""
LEAST_EXPLAINED = 0.01
LONGEST_DELAY = 16
"""A reading may follow the voltage as late as this part of the record (1/16), in a delay or a ringing."""
LARGEST_P_VALUE = 1e-4


@dataclass(frozen=True, slots=True)
class Excitation:
    """What a voltage does.

    Attributes:
        turns: how often it turns round.
        period_s: length of its cycle where one cycle repeats, else None.
        one_amplitude: all cycles reach the same two voltages.
        noise_um: rms of white noise, from third differences.
    """

    turns: int
    period_s: float | None
    one_amplitude: bool
    noise_um: float

    @property
    def single(self) -> bool:
        """One frequency at one amplitude: such a record cannot tell relaxation from hysteresis."""
        return self.period_s is not None and self.one_amplitude


def check_moved(name: str, voltage_V: Array, reading_um: Array) -> None:
    """Refuse a record in which nothing moves.

    Raises:
        InputError: the voltage stands still, or the reading does.
    """
    if float(np.ptp(voltage_V)) <= STILL:
        raise InputError(
            f"{name}: voltage_V is {voltage_V[0]:g} V in all {len(voltage_V)} rows, so it excites nothing; "
            "record steps of several sizes, each held until the reading stands, or a sweep"
        )
    seen = np.isfinite(reading_um)
    y = reading_um[seen] - reading_um[seen].mean()
    if float(np.ptp(y)) <= STILL:
        raise InputError(
            f"{name}: displacement_um stays at {reading_um[seen][0]:g} µm while voltage_V moves over "
            f"{np.ptp(voltage_V):g} V, expected a reading that follows; check the sensor and the columns"
        )


def check_answered(name: str, acting_V: Array, reading_um: Array) -> None:
    """Refuse a record whose readings have nothing to do with the voltage, as far as a linear model can tell.

    Raises:
        InputError: they are explained by no more than chance.
    """
    share, p_value = answered(acting_V, reading_um)
    if share < LEAST_EXPLAINED or p_value > LARGEST_P_VALUE:
        raise InputError(
            f"{name}: voltage_V explains {100 * max(share, 0.0):.2g} % of displacement_um (p = {p_value:.2g}), "
            "expected a reading that follows the voltage; drive further above the noise or check the columns"
        )


def answered(acting_V: Array, reading_um: Array) -> tuple[float, float]:
    """Return the share of the readings' variance that the voltage and what is linear in it explain, and its p-value."""
    seen = np.isfinite(reading_um)
    return _explained(_shapes(acting_V)[seen], reading_um[seen] - reading_um[seen].mean())


def _shapes(voltage_V: Array) -> Array:
    """Return the voltage and what a lag, a derivative or a delay would make of it."""
    slow, fast = np.zeros_like(voltage_V), np.gradient(voltage_V)
    factor = 1.0 - math.exp(-20.0 / len(voltage_V))
    for k in range(1, len(voltage_V)):
        slow[k] = slow[k - 1] + factor * (voltage_V[k] - slow[k - 1])
    rows = 2 ** np.arange(max(int(math.log2(len(voltage_V) / LONGEST_DELAY)), 0))
    late = [np.concatenate([np.full(k, voltage_V[0]), voltage_V[:-k]]) for k in rows]
    return np.column_stack([np.ones_like(voltage_V), voltage_V, slow, fast, *late])


def _explained(shapes: Array, y: Array) -> tuple[float, float]:
    """Return the adjusted coefficient of determination and the p-value of the F-test."""
    from scipy.stats import f

    solution, _, rank, _ = np.linalg.lstsq(shapes, y, rcond=None)
    rss, tss = float(np.sum((y - shapes @ solution) ** 2)), float(y @ y)
    free = len(y) - int(rank)
    if rank < 2 or free < 1:
        return 0.0, 1.0
    adjusted = 1.0 - (rss / free) / (tss / (len(y) - 1))
    statistic = (tss - rss) / (rank - 1) / max(rss / free, 1e-300)
    return adjusted, float(f.sf(statistic, rank - 1, free))


def describe(time_s: Array, acting_V: Array, reading_um: Array) -> Excitation:
    """Describe a voltage by its turning points, and the reading by how well it repeats."""
    turns = reversals(acting_V)
    # the last two found may belong to a cycle that the record cuts off
    levels = acting_V[turns]
    span = float(np.ptp(acting_V))
    upper, lower = levels[0::2], levels[1::2]
    one_amplitude = len(turns) >= 3 and all(np.ptp(x) <= SAME * span for x in (upper, lower))
    period_s = None
    if len(turns) >= 4:
        cycles = np.concatenate([np.diff(time_s[turns[0::2]]), np.diff(time_s[turns[1::2]])])
        if np.ptp(cycles) <= SAME * cycles.mean() + 2.0 * float(np.median(np.diff(time_s))):
            period_s = _period_s(time_s, turns)
    return Excitation(len(turns), period_s, bool(one_amplitude), _noise_um(reading_um))


def _period_s(time_s: Array, turns: NDArray[np.intp]) -> float:
    """Return the mean cycle, from the first to the last turning point of the same kind."""
    same = turns[: len(turns) - (len(turns) + 1) % 2]
    return float(time_s[same[-1]] - time_s[same[0]]) / ((len(same) - 1) // 2)


def cycle_scatter_um(time_s: Array, reading_um: Array, period_s: float) -> float | None:
    """Return the rms by which cycles differ from their mean cycle, drift included; None for fewer than two cycles."""
    seen = np.isfinite(reading_um)
    time, reading = time_s[seen], reading_um[seen]
    count = int((time[-1] - time[0]) / period_s + 1e-9) if seen.any() else 0
    if count < 2:
        return None
    rows = max(8, int(period_s / float(np.median(np.diff(time)))))
    phases = time[0] + period_s * np.arange(rows) / rows
    cycles = np.array([np.interp(phases + k * period_s, time, reading) for k in range(count)])
    spread = cycles - cycles.mean(axis=0)
    return float(np.sqrt(np.mean(spread * spread) * count / (count - 1)))


def _noise_um(reading_um: Array) -> float:
    """Return the rms of white noise from third differences, whatever is slow or jumps seldom."""
    third = np.diff(reading_um[np.isfinite(reading_um)], 3)
    return float(1.4826 * np.median(np.abs(third))) / math.sqrt(20.0) if third.size else 0.0
