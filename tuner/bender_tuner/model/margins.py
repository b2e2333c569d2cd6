"""How far a loop is from instability: gain, phase and delay margin, and the peaks of S and T.

S = 1/(1 + L), T = L/(1 + L); Ms = max |S| is the inverse distance of the Nyquist curve from -1 (Astrom and Murray,
Feedback Systems, 2nd ed., chapter 10; Skogestad and Postlethwaite, Multivariable Feedback Control, section 2.4).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from bender_loop.control.pid import Gains
from bender_tuner.model.loop_transfer import DelayedPlant, is_stable

_ON_REAL_AXIS = 1e-9


@dataclass(frozen=True, slots=True)
class Margins:
    """Margins of one loop; an unstable one has margins 0 and peaks inf.

    Attributes:
        stable: the closed loop is stable.
        gain_margin: factor by which the loop gain may grow; inf if no growth destabilises.
        phase_margin_deg: phase lag that may be added at the worst gain crossover; inf without a crossover.
        delay_margin_s: delay that may be added; inf without a crossover.
        sensitivity_peak: Ms.
        complementary_peak: Mt.
        crossover_rad_per_s: lowest frequency where |L| = 1; NaN without a crossover.
    """

    stable: bool
    gain_margin: float
    phase_margin_deg: float
    delay_margin_s: float
    sensitivity_peak: float
    complementary_peak: float
    crossover_rad_per_s: float


UNSTABLE = Margins(False, 0.0, 0.0, 0.0, math.inf, math.inf, math.nan)


def margins(gains: Gains, plant: DelayedPlant) -> Margins:
    """All margins of `gains` around `plant`."""
    if not is_stable(gains, plant):
        return UNSTABLE
    loop = plant.loop(gains)
    crossovers = _gain_crossovers(gains, plant, loop)
    lags = [float(math.pi + np.angle(plant.loop_at(gains, omega))) % (2.0 * math.pi) for omega in crossovers]
    return Margins(
        stable=True,
        gain_margin=gain_margin(gains, plant),
        phase_margin_deg=min((math.degrees(lag) for lag in lags), default=math.inf),
        delay_margin_s=min((lag / omega for lag, omega in zip(lags, crossovers, strict=True)), default=math.inf),
        sensitivity_peak=_peak(plant, loop, lambda omega: 1.0 / abs(1.0 + plant.loop_at(gains, omega)), 1.0),
        complementary_peak=_peak(plant, loop, lambda omega: _complementary(plant.loop_at(gains, omega)), loop),
        crossover_rad_per_s=crossovers[0] if crossovers else math.nan,
    )


def sensitivity_peak(gains: Gains, plant: DelayedPlant) -> float:
    """Ms alone, on the grid of `plant` without refinement; inf for an unstable loop. Cheap: for objectives."""
    if not is_stable(gains, plant):
        return math.inf
    return float(1.0 / np.min(np.abs(1.0 + plant.loop(gains))))


def gain_margin(gains: Gains, plant: DelayedPlant) -> float:
    """The factor > 1 nearest to 1 that brings the Nyquist curve through -1; inf if there is none."""
    factors = [-1.0 / crossing for _, crossing in negative_real_crossings(gains, plant) if crossing > -1.0]
    return min(factors, default=math.inf)


def negative_real_crossings(gains: Gains, plant: DelayedPlant) -> list[tuple[float, float]]:
    """Where L is real and negative: (omega_rad_per_s, L), ascending; pi/Ts is among them if L is negative there."""
    loop = plant.loop(gains)
    grid = plant.omega_rad_per_s.tolist()
    found = []
    for i in _sign_changes(loop.imag[:-1]):
        if loop.real[i] < 0.0 or loop.real[i + 1] < 0.0:
            omega = _root(lambda omega: plant.loop_at(gains, omega).imag, grid[i], grid[i + 1])
            found.append((omega, plant.loop_at(gains, omega).real))
    found.append((plant.nyquist_rad_per_s, float(loop[-1].real)))
    return [(omega, value) for omega, value in found if value < -_ON_REAL_AXIS]


def _gain_crossovers(gains: Gains, plant: DelayedPlant, loop: NDArray[np.complex128]) -> list[float]:
    grid = plant.omega_rad_per_s.tolist()
    return [
        _root(lambda omega: abs(plant.loop_at(gains, omega)) - 1.0, grid[i], grid[i + 1])
        for i in _sign_changes(np.abs(loop) - 1.0)
    ]


def _peak(
    plant: DelayedPlant,
    loop: NDArray[np.complex128],
    magnitude: Callable[[float], float],
    numerator: NDArray[np.complex128] | float,
) -> float:
    """Largest |numerator / (1 + L)|, found on the grid and refined between the neighbours of the largest point."""
    on_grid = np.abs(numerator / (1.0 + loop))
    i = int(np.argmax(on_grid))
    grid = plant.omega_rad_per_s
    bounds = (grid[max(i - 1, 0)], grid[min(i + 1, grid.size - 1)])
    refined = minimize_scalar(lambda omega: -magnitude(omega), bounds=bounds, method="bounded")
    return max(float(on_grid[i]), -float(refined.fun))


def _complementary(loop: complex) -> float:
    return abs(loop / (1.0 + loop))


def _sign_changes(values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Indices i where values[i] and values[i+1] have opposite signs."""
    return np.flatnonzero(np.signbit(values[1:]) != np.signbit(values[:-1]))


def _root(function: Callable[[float], float], lower: float, upper: float) -> float:
    at_lower, at_upper = function(lower), function(upper)
    if at_lower * at_upper >= 0.0:
        return lower if abs(at_lower) < abs(at_upper) else upper
    return float(brentq(function, lower, upper, xtol=1e-12 * upper))  # pyright: ignore[reportArgumentType]
