"""Linear systems of the first to fourth order behind a delay, and their answer to a held input.

A system is a gain, real poles in series, and modes in parallel: a mass on a spring answers at one point with the sum of
its modes, each with a share of the static gain. The answer is exact: the state moves by the matrix exponential of
every stretch over which the delayed input stands still.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.linalg import expm

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LinearSystem:
    """A linear system.

    Attributes:
        gain: static gain, um/V.
        poles_s: time constants of its real poles, in s.
        modes: (frequency in Hz, damping ratio, share of the static gain) of each mode; shares add to 1.
        delay_s: pure delay of the input.
    """

    gain: float
    poles_s: tuple[float, ...]
    modes: tuple[tuple[float, float, float], ...]
    delay_s: float

    @property
    def order(self) -> int:
        """Order of the differential equation."""
        return len(self.poles_s) + 2 * len(self.modes)

    def matrices(self) -> tuple[Array, Array, Array]:
        """Return A (n, n), B (n,), C (n,) of the system without its delay."""
        n = self.order
        A, B, C = np.zeros((n, n)), np.zeros(n), np.zeros(n)
        fed: int | None = None
        for k, tau in enumerate(self.poles_s):
            A[k, k] = -1.0 / tau
            if fed is None:
                B[k] = 1.0 / tau
            else:
                A[k, fed] = 1.0 / tau
            fed = k
        if not self.modes:
            C[len(self.poles_s) - 1] = self.gain
        for j, (frequency_Hz, zeta, share) in enumerate(self.modes):
            omega = 2.0 * math.pi * frequency_Hz
            q = len(self.poles_s) + 2 * j
            A[q, q + 1] = 1.0
            A[q + 1, q], A[q + 1, q + 1] = -omega * omega, -2.0 * zeta * omega
            if fed is None:
                B[q + 1] = omega * omega
            else:
                A[q + 1, fed] = omega * omega
            C[q] = self.gain * share
        return A, B, C

    def answer(self, time_s: Array, held_V: Array) -> Array:
        """Return the reading (n,) at every row, from rest; row k is read before its own input acts.

        Args:
            time_s: (n,) rows, increasing.
            held_V: (n,) inputs, each held until the next row.
        """
        A, B, C = self.matrices()
        n = self.order
        acting = time_s + self.delay_s
        edges = np.unique(np.round(np.concatenate([time_s, acting[acting <= time_s[-1]]]), 12))
        moves: dict[float, tuple[Array, Array]] = {}
        state, read = np.zeros(n), {float(edges[0]): 0.0}
        for begin, end in itertools.pairwise(edges):
            length = round(float(end - begin), 12)
            if length not in moves:
                block = np.zeros((n + 1, n + 1))
                block[:n, :n], block[:n, n] = A * length, B * length
                whole: Array = np.asarray(expm(block), dtype=np.float64)
                moves[length] = (
                    np.asarray(whole[:n, :n], dtype=np.float64),
                    np.asarray(whole[:n, n], dtype=np.float64),
                )
            held = np.searchsorted(acting, begin + 1e-9, side="right") - 1
            u = float(held_V[held]) if held >= 0 else 0.0
            phi, gamma = moves[length]
            state = phi @ state + gamma * u
            read[float(end)] = float(C @ state)
        return np.array([read[float(t)] for t in np.round(time_s, 12)])


def drawn_system(order: int, rng: Generator, row_s: float = 0.01) -> LinearSystem:
    """Return a system of the given order whose every part shows at this time between rows.

    The delay is 0 to 5 times the slowest lag (or the period of the slowest mode over 2 pi).

    Raises:
        ValueError: the order is not 1 to 4.
    """
    if order not in (1, 2, 3, 4):
        raise ValueError(f"order: found {order}, expected 1 to 4")
    lags, modes = (order % 2, order // 2) if order < 4 or rng.random() < 0.5 else (2, 1)
    if order == 2 and rng.random() < 0.5:
        lags, modes = 2, 0
    slow = float(rng.uniform(8.0, 40.0)) * row_s
    poles = [slow] if lags else []
    if lags == 2:
        poles.append(slow / float(rng.uniform(2.5, 6.0)))
    found: list[tuple[float, float, float]] = []
    if modes:
        low = float(rng.uniform(0.03, 0.08)) / row_s
        zeta = float(np.exp(rng.uniform(math.log(0.02), math.log(0.3))))
        found.append((low, zeta, 1.0))
    if modes == 2:
        share = float(rng.uniform(0.15, 0.4))
        frequency, zeta, _ = found[0]
        high = frequency * float(rng.uniform(2.2, 4.5))
        found = [(frequency, zeta, 1.0 - share), (high, float(rng.uniform(0.02, 0.1)), share)]
    lag_s = poles[0] if poles else 1.0 / (2.0 * math.pi * found[0][0])
    delay_s = float(rng.choice([0.0, 1.0])) * float(rng.uniform(0.2, 5.0)) * lag_s
    return LinearSystem(float(rng.uniform(0.1, 2.0)), tuple(poles), tuple(found), delay_s)
