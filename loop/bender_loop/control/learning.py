"""Iterative learning: what repeats is corrected from pass to pass, through the inverse of the model.

The inverse of the model is given another target than the reference, which is moved after every pass by what was missed:

    p_(j+1)(t) = p_j(t) + L(q) (r(t) - y_j(t)),    p_0 = r

With a model that is right one pass is enough; one whose gain is wrong by a factor a leaves the part |1 - a| of the
error in every pass. L is a symmetric smoothing without phase (the Q filter: S. Arimoto, S. Kawamura and F. Miyazaki,
Bettering operation of robots by learning, Journal of Robotic Systems 1 (1984) 123-140; D. A. Bristow, M. Tharayil and
A. G. Alleyne, A survey of iterative learning control, IEEE Control Systems Magazine 26 (2006) 96-114), and it is
smaller where the error of a pass is mostly noise.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GAIN = 0.9
"""Of the missed part; less than 1 leaves room for a model that answers too little."""
KERNEL = (0.25, 0.5, 0.25)
BETTER = 0.95
"""A pass that is not better than the best by this factor has learned nothing more."""
PATIENCE = 2
"""So many passes without anything learned end the learning."""


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """What the passes have come to.

    Attributes:
        target_um: (n,) that the inverse is given in the next pass, at the samples of the reference.
        best_um: (n,) that of the best pass.
        errors_um: rms of every pass.
        idle: passes since the best one.
    """

    target_um: Array
    best_um: Array
    errors_um: tuple[float, ...] = ()
    idle: int = 0

    @property
    def is_over(self) -> bool:
        """Whether nothing more is learned."""
        return self.idle >= PATIENCE

    @property
    def best_error_um(self) -> float:
        """Rms of the best pass, inf before the first one."""
        return min(self.errors_um, default=math.inf)


def begin(reference_um: Array) -> Learned:
    """Return what is known before the first pass: nothing."""
    start = np.array(reference_um, dtype=float)
    return Learned(start, start)


def first_reached(dead_time_s: float, period_s: float) -> int:
    """Return the first reading that the command of the first one can reach."""
    return 1 + math.ceil(dead_time_s / period_s - 1e-9)


def learn(known: Learned, reference_um: Array, read_um: Array, noise_um: float, begins: int = 0) -> Learned:
    """Return what is known after a pass.

    What is missed before the first command can show is no command's fault: it is neither learned from nor judged.

    Args:
        known: before it; its `target_um` was played.
        reference_um: (n,) set-points.
        read_um: (n,) readings at the same instants; nan where one was lost, which teaches nothing.
        noise_um: standard deviation of a reading.
        begins: first reading that the first command can reach.
    """
    taught = np.isfinite(read_um) & (np.arange(read_um.size) >= begins)
    error = np.where(taught, reference_um - read_um, 0.0)
    rms = float(np.sqrt(np.mean(error**2)))
    improved = rms < BETTER * known.best_error_um
    best = known.target_um if improved or not known.errors_um else known.best_um
    signal = max(rms**2 - noise_um**2, 0.0) / rms**2 if rms > 0.0 else 0.0
    base = known.target_um if rms <= known.best_error_um else best
    target = base + GAIN * signal * smooth(error) if rms <= known.best_error_um else base
    return Learned(target, best, (*known.errors_um, rms), 0 if improved else known.idle + 1)


def smooth(error_um: Array) -> Array:
    """Return the error through the symmetric kernel, its ends carried on."""
    padded = np.pad(error_um, len(KERNEL) // 2, mode="edge")
    return np.convolve(padded, KERNEL, mode="valid")
