"""What a spring can leave of the Silverbox, by an integrator and an interpolation that share no code with the plant."""

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numba import njit
from scipy.optimize import least_squares
from scipy.signal import firwin, resample_poly

RECORD = Path(__file__).parents[3] / "shared" / "data" / "rigs" / "silverbox_multisine.csv"
FITTED, PARTS, BOUND_mV = 20_000, 4, 0.45


@njit
def duffing(gain, omega, damping, square, cube, x0, v0, drive, step, parts, rows):
    """Runge-Kutta of x'' + 2 ζ ω x' + ω² (x + square x² + cube x³) = ω² gain u, x at the rows; u at half steps."""
    found, x, v, w2 = np.empty(rows), x0, v0, omega * omega
    for k in range(rows):
        found[k] = x
        for part in range(parts):
            at = 2 * (k * parts + part)
            rate_x, rate_v, p, q = 0.0, 0.0, x, v
            for stage in range(4):
                u = drive[at + (stage + 1) // 2]
                slope = w2 * (gain * u - p - square * p * p - cube * p * p * p) - 2.0 * damping * omega * q
                weight, ahead = (1.0, 0.5) if stage == 0 else (2.0, 0.5) if stage == 1 else (2.0, 1.0)
                if stage == 3:
                    weight = 1.0
                rate_x, rate_v = rate_x + weight * q, rate_v + weight * slope
                p, q = x + ahead * step * q, v + ahead * step * slope
            x, v = x + step / 6.0 * rate_x, v + step / 6.0 * rate_v
    return found


def left_mV(squares: bool) -> float:
    """Return the standard deviation of the residual on the held-out rows, those after the fitted ones."""
    time_s, volts, reading = np.loadtxt(RECORD, delimiter=",", skiprows=1).T
    row_s, finer = float(time_s[1] - time_s[0]), 2 * PARTS
    window = firwin(2 * 24 * finer + 1, 1.0 / finer, window=cast(Any, ("kaiser", 8.0)))
    drive = resample_poly(np.append(volts, volts[-1]), finer, 1, window=window, padtype="line")[
        : finer * len(volts) + 1
    ]

    def simulated(p: np.ndarray) -> np.ndarray:
        square = 1e-4 * p[7] if squares else 0.0
        numbers = (1e3 * p[0], 100.0 * p[1], p[2], square, 1e-6 * p[3], 100.0 * p[5], 1e4 * p[6])
        return duffing(*numbers, drive, row_s / PARTS, PARTS, len(volts)) + p[4]

    start = np.array([1.0, 4.29, 0.0487, 4.0, -5.2, reading[0] / 100.0, 0.0, *([-1.0] if squares else [])])
    best = least_squares(lambda p: (simulated(p) - reading)[:FITTED], start, x_scale="jac")
    return float(np.std((reading - simulated(best.x))[FITTED:]))


@pytest.mark.slow
@pytest.mark.skipif(not RECORD.is_file(), reason="the records of other rigs are not here")
def test_a_cubic_spring_alone_cannot_leave_so_little_and_with_a_square_it_can() -> None:
    cubic, both = left_mV(squares=False), left_mV(squares=True)
    print(f"cubic spring: {cubic:.3f} mV, with a square: {both:.3f} mV")
    assert cubic > BOUND_mV > both
